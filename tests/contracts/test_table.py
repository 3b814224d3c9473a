"""The pages of the table and between releases are those of the rows that are stored."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks import releases, table, table_page

HERE = table.ROWS.parent


def body(name: str) -> str:
    """Return a page without the lines that say where it comes from."""
    return (HERE / name).read_text(encoding="utf-8").split("---\n", 2)[2].lstrip()


def test_the_pages_are_made_of_the_rows() -> None:
    again = "python -m benchmarks.table_page; python -m benchmarks.releases --page"
    assert body("table.md") == table_page.page(table.ROWS), again
    assert body("between-releases.md") == releases.page(), again


@pytest.mark.parametrize(
    ("who", "task", "leaves", "words"),
    [
        ("eutree", "MountainCar-v0", 5, "{:.1f} in 500 k, ten runs"),
        ("eutree", "MountainCar-v0", 8, "with at most 8 {:.1f} |"),
        ("eutree", "Acrobot-v1", 8, "in 500 k {:.1f} with 8"),
        ("eutree", "LunarLander-v3", 32, "{:.1f} with 32, "),
        ("derived", "LunarLander-v3", 16, "{:.1f} with at most 16 leaves "),
        ("derived", "LunarLander-v3", 8, "{:.1f} with 8, "),
        ("derived", "LunarLander-v3", 32, "{:.1f} with 32, by two"),
        ("sums", "LunarLander-v3", 32, "(*sums*) {:.1f} with 32"),
        ("sums", "LunarLander-v3", 16, "and {:.1f} with 16 in "),
        ("sums", "LunarLander-v3", 4, "{:.1f} with 4; by raw"),
        ("eutree", "TwoTanks-v0", 16, "{:.1f} with 16 leaves, "),
    ],
)
def test_the_aims_say_what_the_cells_say(who: str, task: str, leaves: int, words: str) -> None:
    place = {"who": who, "steps": "500000", "leaves": str(leaves)}
    cell = [
        float(row["return"])
        for path in table.ROWS.glob("*.csv")
        for row in table.rows_of(path)
        if row["task"] == task and place.items() <= row.items()
    ]
    assert words.format(np.mean(cell)) in table_page.AIMS


def test_every_row_of_the_table_is_of_a_seed_that_tuning_never_saw() -> None:
    for path in table.ROWS.glob("*.csv"):
        rows = table.rows_of(path)
        cells = [(row["who"], row["steps"], row["leaves"], row["seed"]) for row in rows]
        assert len(set(cells)) == len(cells), f"{path.name}: a cell stands there twice"
        for row in rows:
            assert int(row["seed"]) >= table.FIRST
            assert int(row["used"]) <= int(row["steps"])
            assert int(row["has_leaves"]) <= int(row["leaves"])


@pytest.mark.parametrize(
    ("now", "then", "expected"),
    [([1, 1], [1, 1], 0.5), ([2, 3], [1, 1], 1.0), ([0, 2], [1, 1], 0.5), ([0, 1, 2], [1], 0.5),
     ([1, 1, 2], [1, 3], (0.5 + 0.5 + 1.0) / 6)],
)  # fmt: skip
def test_the_probability_of_improvement_counts_pairs_and_halves_of_ties(
    now: list[float], then: list[float], expected: float
) -> None:
    given = np.array(now, dtype=float), np.array(then, dtype=float)
    assert releases.probability(*given) == pytest.approx(expected)
    low, high = releases.interval(*given)
    assert low <= expected <= high


def rows(returns: list[float], leaves: int) -> list[dict[str, str]]:
    return [{"task": "T", "return": str(one), "has_leaves": str(leaves)} for one in returns]


def test_a_task_is_worse_where_it_earns_less_or_its_trees_are_larger() -> None:
    then = rows([1.0, 2.0, 3.0], 4)
    assert not releases.is_worse(then, then, "T")
    assert releases.is_worse(rows([0.0, 0.0, 0.5], 4), then, "T")
    assert releases.is_worse(rows([1.0, 2.0, 3.0], 8), then, "T")
    assert not releases.is_worse(rows([2.0, 3.0, 4.0], 6), then, "T")


def test_the_command_fails_where_a_default_has_grown_worse(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The stored rows are learned again: as they were, with lower returns, with larger trees."""
    stored = releases.latest(releases.stored())
    monkeypatch.setattr("sys.argv", ["releases"])
    for planted in ({}, {"return": "90.0"}, {"has_leaves": "9"}):
        now = [row | (planted if row["task"] == "CartPole-v1" else {}) for row in stored]
        monkeypatch.setattr(releases, "run", lambda *_, now=now: now)
        with pytest.raises(SystemExit) as ended:
            releases.main()
        assert ended.value.code == bool(planted)
        assert ("**worse**" in capsys.readouterr().out) == bool(planted)


def test_the_settings_of_a_task_of_the_examples_are_those_of_the_example() -> None:
    from examples.two_tanks import FloatSwitch, method_for

    settings = table.Settings.of("TwoTanks-v0")
    assert isinstance(settings.expert, FloatSwitch)
    assert settings.method == replace(method_for(20), max_leaves=settings.method.max_leaves)
    assert settings.method.world_model.memory


def test_the_settings_of_a_task_say_how_it_is_made_and_who_shows_it() -> None:
    from examples.inventory import order_up_to

    assert table.Settings.of("Inventory-v0").expert is order_up_to
    pendulum = table.Settings.of("Pendulum-v1")
    env = table.make(table.EnvironmentSpec("Pendulum-v1", pendulum.arguments))
    assert env.action_space.n == 5


def test_who_has_derived_features_is_told_apart_and_its_trees_too() -> None:
    raw = table.Cell("eutree", "LunarLander-v3", 100_000, 8, 20_000)
    derived = replace(raw, who="derived")
    assert table.tree_of(raw) != table.tree_of(derived)
    assert table.Settings.of(raw.task, raw.who).derived.derived == ()
    declared = table.Settings.of(derived.task, derived.who).derived.derived
    assert [one.partition(" = ")[0] for one in declared] == ["tilt", "drop"]


def test_rows_of_raw_numbers_have_no_sums_whatever_the_settings_say() -> None:
    method = table.chosen_method(
        None, offline=False, settings=table.zoo.settings_of("LunarLander-v3"), changes=(),
        discount=None,
    )  # fmt: skip
    assert method.sums == table.Settings.of("LunarLander-v3", "sums").method.sums == 3
    for who in ("eutree", "derived"):
        assert table.Settings.of("LunarLander-v3", who).method.sums == 0
    assert table.Settings.of("Acrobot-v1", "sums").method.sums == 3


def test_a_task_is_compared_with_the_last_release_that_has_it(tmp_path: Path) -> None:
    for name, tasks in (("001.csv", ("A", "B")), ("002.csv", ("B",))):
        lines = ["task,return", *(f"{task},{name[:3]}" for task in tasks)]
        (tmp_path / name).write_text("\n".join(lines) + "\n")
    found = releases.latest(sorted(tmp_path.glob("*.csv")))
    assert {row["task"]: row["return"] for row in found} == {"A": "001", "B": "002"}
    assert {row["task"]: row["file"] for row in found} == {"A": "001", "B": "002"}


def test_a_row_between_releases_names_the_file_that_it_is_compared_with() -> None:
    known = {path.stem for path in releases.stored()}
    cells = [line.split(" | ") for line in body("between-releases.md").splitlines()]
    before = [cell[1].partition(":")[0] for cell in cells if len(cell) == 5 and ":" in cell[1]]
    assert len(before) >= 5
    assert set(before) <= known
    cart_pole = [cell[1] for cell in cells if cell[0] == "| CartPole-v1"]
    assert cart_pole[-1].startswith("001-")  # the third's: the second has no run of it


def test_cells_that_were_run_again_are_compared_seed_by_seed():
    old = [
        {"who": "eutree", "task": "T-v0", "steps": "10000", "leaves": "8", "seed": str(seed),
         "return": str(10.0 * seed), "success": "", "has_leaves": "8", "used": "9999",
         "cpu_s": "3.0", "commit": "a"}
        for seed in (1, 2, 3)
    ]  # fmt: skip
    new = [row | {"return": str(float(row["return"]) + 5), "cpu_s": "4"} for row in old]
    assert list(table_page.compared(new, old)) == []  # of the same commit
    (line,) = table_page.compared([row | {"commit": "b"} for row in new[:2]], old)
    assert line.startswith("| T-v0, 10,000 | 8 | 15.0 ")
    assert "| 20.0 " in line
    assert line.endswith("| 5.0 [5.0, 5.0] | 3, 4 |")
