"""Every page of figures says where its figures come from, and the list of old ones is right."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs" / "results" / "provenance.py"

spec = importlib.util.spec_from_file_location("provenance", SCRIPT)
assert spec is not None
assert spec.loader is not None
provenance = importlib.util.module_from_spec(spec)
sys.modules["provenance"] = provenance
spec.loader.exec_module(provenance)


def test_every_page_of_figures_says_where_they_come_from():
    pages = provenance.pages()
    assert len(pages) >= 19
    for name, page in pages.items():
        for source in page.sources:
            assert (ROOT / source).exists(), f"{name}: there is no {source}"
        for command in page.command.split(" && "):
            words = command.split()
            assert words[0] in ("python", "eutree"), f"{name}: {command}"
            for word in words:
                if word.endswith(".py"):
                    assert (ROOT / word).exists(), f"{name}: there is no {word}"


def test_every_page_of_figures_names_a_commit_that_everybody_has():
    """A commit of a branch that was rebased later is in its author's clone alone."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    if git(ROOT, "rev-parse", "--is-shallow-repository") == "true":
        pytest.skip("a shallow clone does not know the commits")
    strangers = {n: page.commit for n, page in provenance.pages().items() if not page.in_history()}
    assert strangers == {}


def test_a_page_that_says_twice_where_it_comes_from_is_refused():
    """The documentation reads the second time as a heading, and does not build."""
    head = provenance.Provenance("python b.py", "f3056a0", "2026-01-01", ("b.py",))
    assert provenance.Provenance.of(f"{head}\n# Title\n") == head
    with pytest.raises(ValueError, match="got it twice"):
        provenance.Provenance.of(f"{head}\n{head}\n# Title\n")


def git(folder, *arguments):
    names = ["-c", "user.name=a", "-c", "user.email=a@localhost"]
    done = subprocess.run(["git", *names, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def repository(tmp_path):
    """A repository with a script, its page, and another page that the script does not decide."""
    (tmp_path / "docs" / "results").mkdir(parents=True)
    (tmp_path / "b.py").write_text("print(1)")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    first = git(tmp_path, "rev-parse", "--short", "HEAD")
    for name, source in (("old", "b.py"), ("new", "docs/results/old.md")):
        head = provenance.Provenance("python b.py", first, "2026-01-01", (source,))
        (tmp_path / "docs" / "results" / f"{name}.md").write_text(f"{head}\n# Title\n")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "pages")
    return tmp_path


def test_a_page_is_old_when_a_source_of_it_has_changed_since(repository):
    assert [name for name in provenance.outdated(repository) if name == "old"] == []
    (repository / "b.py").write_text("print(2)")
    git(repository, "commit", "-qam", "Print something else")
    (changes,) = [c for name, c in provenance.outdated(repository).items() if name == "old"]
    assert len(changes) == 1
    assert changes[0].endswith("Print something else")


def test_a_page_whose_commit_was_rebased_away_is_listed_as_of_unknown_age(repository):
    git(repository, "commit", "-q", "--amend", "-m", "the same, said better")
    page = repository / "docs" / "results" / "old.md"
    lost = git(repository, "rev-parse", "--short", "HEAD@{1}")
    first = provenance.Provenance.of(page.read_text()).commit
    page.write_text(page.read_text().replace(first, lost))
    (change,) = provenance.outdated(repository)["old"]
    assert change == f"unknown: {lost} is not in the history of HEAD"


def test_stamping_gives_a_rewritten_page_its_lines_back_with_the_present_commit(repository):
    page = repository / "docs" / "results" / "old.md"
    page.write_text("# Title\n\nnew figures\n")
    provenance.stamp("old", repository)
    found = provenance.Provenance.of(page.read_text())
    assert (found.command, found.sources) == ("python b.py", ("b.py",))
    assert found.commit == git(repository, "rev-parse", "--short", "HEAD")
    assert found.date > "2026-01-01"
    assert page.read_text().endswith("---\n\n# Title\n\nnew figures\n")
    once = page.read_text()
    provenance.stamp("old", repository)
    assert page.read_text() == once


def test_stamping_wraps_what_a_script_has_written_in_long_lines(repository):
    page = repository / "docs" / "results" / "old.md"
    page.write_text(f"# Title\n\n{'figures ' * 30}\n")
    provenance.stamp("old", repository)
    assert max(map(len, page.read_text().splitlines())) <= 100
    assert page.read_text().count("figures") == 30


def test_a_page_without_the_lines_is_refused():
    with pytest.raises(ValueError, match="must begin with '---'"):
        provenance.Provenance.of("# Title\n")
    with pytest.raises(ValueError, match="command, commit, date and sources"):
        provenance.Provenance.of("---\ncommand: x\n---\n# Title\n")
