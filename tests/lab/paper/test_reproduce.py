"""Each experiment runs in small, judges its claims, and never does a finished run again."""

import dataclasses
import json

import numpy as np
import pytest

from eutree.cli.main import run as run_cli
from eutree.evaluation.evaluation import Estimate, Interval
from eutree_lab.paper import results as results_module
from eutree_lab.paper.claims import FAILS, HOLDS, OPEN, SMOKE_RUN, close_to, judged
from eutree_lab.paper.experiment import FULL, SMOKE
from eutree_lab.paper.reproduce import EXPERIMENTS, chosen, claims_to_markdown, reproduce
from eutree_lab.paper.results import Results
from eutree_lab.paper.runs import RunSpec, run

TINY = dataclasses.replace(SMOKE, runs=2, episodes=6, evaluate_every=3, final_episodes=6)

CLAIMS = {
    "figure-2": {"half-the-trials", "dt-similar", "above-at-every-point", "c-u-tree-learns"},
    "figure-3": {"half-the-trials", "dt-similar", "above-at-every-point", "c-u-tree-learns"},
    "table-2": {"expert-tree/states", "c-u-tree/reward", "eu-tree/states", "far-more-states"},
    "figure-4a": {"slower-opponents", "half-at-the-fastest"},
    "figure-4b": {"time-follows-quality"},
    "figure-5": {"no-worse-than-c-u-tree", "scales-with-quality"},
    "expert": {"perfect-in-2-evasion", "perfect-in-3-evasion"},
    "compression": {"less-than-half", "no-loss", "never-larger", "same-mapping"},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder in which runs are shared by the tests of this module."""
    return tmp_path_factory.mktemp("results")


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_runs_in_small_and_judges_its_claims(folder, name):
    found = reproduce(chosen(name), folder, scale=TINY, presets=("paper",))
    names = {claim.id.removeprefix(f"{name}/") for claim in found.claims}
    assert names >= CLAIMS[name]
    for claim in found.claims:
        assert claim.holds in (HOLDS, FAILS, OPEN)
        assert claim.interval[0] <= claim.ours <= claim.interval[1] or np.isnan(claim.ours)
    written = json.loads((folder / "claims.json").read_text())
    assert [entry["id"] for entry in written["claims"]] == [claim.id for claim in found.claims]
    page = (folder / "report.html").read_text()
    assert all(claim.holds in page for claim in found.claims)
    if EXPERIMENTS[name].draw is not None:
        assert (folder / f"{name}.svg").stat().st_size > 5_000
        assert '<img src="data:image/svg+xml;base64,' in page
        assert "style=" not in page.split("<body>")[1], "the page's own policy refuses it: black"
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_finished_runs_are_not_done_again(folder, monkeypatch):
    reproduce(chosen("figure-2"), folder, scale=TINY, presets=("paper",))

    def fail(spec):
        raise AssertionError(f"{spec.name} was done again")

    monkeypatch.setattr(results_module, "run", fail)
    reproduce(chosen("table-2"), folder, scale=TINY, presets=("paper",))
    other = dataclasses.replace(TINY, first_seed=99)
    with pytest.raises(AssertionError, match="was done again"):
        reproduce(chosen("table-2"), folder, scale=other, presets=("paper",))


def test_an_interruption_keeps_the_runs_that_are_done(tmp_path, monkeypatch):
    specs = chosen("expert")[0].specs(TINY, "paper")
    done = []

    def interrupted(spec):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(spec)
        return run(spec)

    monkeypatch.setattr(results_module, "run", interrupted)
    results = Results(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        results.complete(specs)
    kept = [spec for spec in specs if results.has(spec)]
    assert 2 <= len(kept) < len(specs)
    assert [record.spec for record in results.load(kept)] == kept


def files_of(path):
    return {p.name: p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


@pytest.mark.promise(13)
def test_two_processes_give_the_same_bytes_as_one(tmp_path):
    for name, n_jobs in (("one", 1), ("two", 2)):
        reproduce(
            chosen("figure-2"), tmp_path / name, scale=TINY, presets=("paper",), n_jobs=n_jobs
        )
    assert files_of(tmp_path / "one") == files_of(tmp_path / "two")


def test_the_name_of_a_run_tells_apart_whatever_decides_its_result():
    spec = FULL.spec("eutree/Evasion2-v0", "eu-tree", "paper", 0)
    others = [
        dataclasses.replace(spec, **change)
        for change in (
            {"environment": "eutree/Evasion3-v0"},
            {"learner": "eu-tree-dt"},
            {"preset": "default"},
            {"opponent_speed": 3.3},
            {"demonstrations": 14},
            {"episodes": 401},
            {"evaluate_every": 21},
            {"evaluation_episodes": 99},
            {"final_episodes": 999},
            {"seed": 1},
        )
    ]
    assert len({spec.name, *(other.name for other in others)}) == len(others) + 1
    assert {field.name for field in dataclasses.fields(RunSpec)} == set(vars(spec))


def test_the_full_scale_is_the_paper_s_protocol():
    assert (FULL.runs, FULL.evaluate_every, FULL.evaluation_episodes) == (15, 20, 100)
    assert FULL.speeds[0] == 2.2
    assert FULL.speeds[-1] == 4.2
    assert len(FULL.speeds) == 21


@pytest.mark.parametrize(
    ("interval", "verdict"),
    [((0.1, 0.4), HOLDS), ((0.6, 0.9), FAILS), ((0.4, 0.6), OPEN)],
)
def test_verdicts_follow_from_the_interval(interval, verdict):
    estimate = Estimate(sum(interval) / 2, Interval(*interval), 15)
    claim = judged("x/y", "s", paper="< 0.5", estimate=estimate, high=0.5, rule="below")
    assert claim.holds == verdict
    near = close_to("x/z", "s", number=0.25, estimate=estimate, tolerance=0.25)
    assert near.holds == verdict
    assert f"**{verdict}**" in claims_to_markdown([claim])


def test_a_smoke_run_says_so_wherever_it_gives_verdicts(tmp_path):
    """They stood there like verdicts on the paper."""
    for scale, smoke in ((TINY, True), (dataclasses.replace(TINY, smoke=False), False)):
        reproduce(chosen("expert"), tmp_path, scale=scale, presets=("paper",))
        page, table = ((tmp_path / name).read_text() for name in ("report.html", "claims.md"))
        assert (SMOKE_RUN in page, SMOKE_RUN in table) == (smoke, smoke)
        assert json.loads((tmp_path / "claims.json").read_text())["smoke"] == smoke


def test_the_command_lists_and_runs(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_cli(["reproduce", "--list", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == [*EXPERIMENTS, "framework"]
    line = ["reproduce", "expert", "--smoke", "--preset", "paper", "--json", "--out", "r"]
    assert run_cli(line) == 0
    answer = json.loads(capsys.readouterr().out)
    for claim in answer["claims"]:
        assert claim.keys() >= {"id", "paper", "ours", "interval", "holds"}
    assert answer["smoke"]
    assert run_cli(["reproduce", "figure-9"]) == 2
    assert "Did you mean 'figure-" in capsys.readouterr().err
