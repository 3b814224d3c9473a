"""The framework: every method from every start in small, paired seeds, and verdicts by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from eutree.cli.main import run as run_cli
from eutree.errors import InvalidArgumentError
from eutree.evaluation.evaluation import Estimate, Interval
from eutree.learners import METHODS
from eutree_lab.framework import report as framework_report
from eutree_lab.framework import runs as framework
from eutree_lab.framework.report import FrameworkResults, reproduce_framework
from eutree_lab.framework.runs import (
    ARMS,
    DAGGER,
    FROZEN,
    GOOD,
    LEFT_OUT,
    MAIN_ARMS,
    NOTHING,
    POOR_TREE_AND_DEMOS,
    RANDOM_TREE,
    TASKS,
    TAUGHT,
    TREE,
    TREE_AND_DEMOS,
    Arm,
    Evaluated,
    FrameworkRecord,
    FrameworkSpec,
    run,
    specs,
)
from eutree_lab.framework.verdicts import (
    EXPECTATIONS,
    REFUSED,
    Expectation,
    Finding,
    Runs,
    Times,
    for_good,
    halved,
    ratio_of_times,
    verdict,
)
from eutree_lab.paper.claims import FAILS, HOLDS, OPEN

METHODS_RUN = ("density-tree", "parti-game")
SMALL = specs(runs=2, methods=METHODS_RUN, smoke=True, first_seed=5)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return the folder of a tiny experiment, and what it found."""
    folder = tmp_path_factory.mktemp("framework")
    return folder, reproduce_framework(SMALL, folder)


def test_every_method_is_taught_or_left_out_with_a_reason_and_has_one_expectation():
    assert {*TAUGHT, *LEFT_OUT} == set(METHODS)
    assert all(LEFT_OUT.values())
    times = [e.method for e in EXPECTATIONS if e.second is None]
    assert sorted(times) == sorted(TAUGHT)
    assert {e.expected for e in EXPECTATIONS} == {HOLDS, FAILS}


def test_runs_come_seed_by_seed_and_have_names_of_their_own():
    wanted = specs(runs=3, first_seed=7)
    per_seed = len(TASKS) * (4 + len(TAUGHT) * len(ARMS))
    assert len(wanted) == 3 * per_seed
    main = [spec.arm in MAIN_ARMS for spec in wanted]
    assert main == sorted(main, reverse=True)
    assert [spec.seed for spec in wanted if spec.arm in MAIN_ARMS] == sorted(
        [7, 8, 9] * (len(TASKS) * (1 + 2 * len(TAUGHT)))
    )
    assert len({spec.name for spec in wanted}) == len(wanted)
    other = specs(runs=3, first_seed=7, smoke=True)
    assert {spec.name for spec in wanted}.isdisjoint(spec.name for spec in other)


def test_the_small_experiment_is_reported(done):
    folder, found = done
    page = (folder / "framework.md").read_text()
    assert {v.n_seeds for v in found.verdicts if v.holds != REFUSED} == {2}
    for task in TASKS.values():
        assert f"## {task.title}\n" in page
    assert "refused: it needs a goal" in page
    assert page.count("| expert tree | frozen") == 2 * len(TASKS)
    assert page.count("| expert tree | dagger") == 2 * len(TASKS)
    written = json.loads((folder / "verdicts.json").read_text())
    assert [v["holds"] for v in written["verdicts"]] == [v.holds for v in found.verdicts]
    for name in TASKS:
        svg = (folder / f"framework-{name}.svg").read_text()
        assert svg.startswith("<?xml")
    assert set(FrameworkResults(folder).seconds()) == {spec.name for spec in SMALL}


def test_all_arms_of_a_seed_have_the_same_demonstrations_and_evaluation_episodes(done):
    """The first policy of the arm is the expert tree: the same returns to the bit."""
    records = FrameworkResults(done[0]).load(SMALL)
    runs = Runs(records)
    for task in TASKS:
        frozen = runs.cell(task, "", Arm(FROZEN), [5, 6])
        for arm in (TREE, TREE_AND_DEMOS):
            taught = runs.cell(task, "density-tree", arm, [5, 6])
            assert taught[0].demonstrated_steps == frozen[0].demonstrated_steps
        alike = [r.curve[0].mean_return for r in runs.cell(task, "density-tree", TREE, [5, 6])]
        assert alike == [r.curve[0].mean_return for r in frozen]
        assert [r.spec.seed for r in taught] == [r.spec.seed for r in frozen] == [5, 6]
        steps = {r.demonstrated_steps for r in frozen}
        assert len(steps) == 2 or task == "cart-pole"  # other seeds, other demonstrations


def test_dagger_has_the_methods_episodes_and_learns_of_its_own_ones_what_was_right(done):
    runs = Runs(FrameworkResults(done[0]).load(SMALL))
    for task, settings in TASKS.items():
        frozen = runs.cell(task, "", Arm(FROZEN), [5, 6])
        methods = runs.cell(task, "density-tree", TREE, [5, 6])
        for record, start, method in zip(
            runs.cell(task, "", Arm(DAGGER), [5, 6]), frozen, methods, strict=True
        ):
            assert [p.episode for p in record.curve] == [p.episode for p in method.curve]
            assert record.curve[0] == start.curve[0]  # the expert tree, on the same episodes
            assert record.demonstrated_steps == start.demonstrated_steps
            assert record.learning_steps >= settings.small().episodes


def test_dagger_mends_a_tree_of_one_demonstration():
    """Of one episode C4.5 knows little; its demonstrator knows what was right in the next ones."""
    settings = replace(
        TASKS["evasion"].small(), demonstrations=1, episodes=40, gathering_episodes=20,
        evaluate_every=20, evaluation_episodes=100,
    )  # fmt: skip
    gains = []
    for seed in range(5):
        spec = FrameworkSpec(
            task="evasion", settings=settings, method="", arm=Arm(DAGGER), seed=seed
        )
        made, _ = run(spec)
        gains.append(made.curve[-1].mean_return - made.curve[0].mean_return)
    assert np.mean(gains) > 2 * np.std(gains, ddof=1) / np.sqrt(5)


def test_finished_runs_are_not_done_again_and_a_missing_one_costs_its_pair(done, monkeypatch):
    folder, found = done

    def fail(spec):
        raise AssertionError(f"{spec.name} was done again")

    monkeypatch.setattr(framework_report, "run", fail)
    again = reproduce_framework(SMALL, folder)
    assert [v.estimate for v in again.verdicts] == [v.estimate for v in found.verdicts]
    cell = ("evasion", "density-tree", TREE_AND_DEMOS, 6)
    (spec,) = [s for s in SMALL if (s.task, s.method, s.arm, s.seed) == cell]
    last = folder / "runs" / f"{spec.name}.json"
    kept = last.read_bytes()
    last.unlink()
    with pytest.raises(AssertionError, match="was done again"):
        reproduce_framework(SMALL, folder)
    found = framework_report.report(SMALL, FrameworkResults(folder)).verdicts
    seeds = {(v.expectation.method, v.expectation.second): v.n_seeds for v in found}
    assert seeds["density-tree", None] == 1
    assert seeds["density-tree", RANDOM_TREE] == seeds["parti-game", None] == 2
    last.write_bytes(kept)


def test_a_run_of_other_choices_is_another_run(monkeypatch):
    """Records of a method whose defaults changed were taken for those of today."""
    before = {spec.name for spec in SMALL}
    monkeypatch.setattr(
        framework, "method_for", lambda name, task: METHODS["density-tree"](discount=0.5)
    )
    now = specs(runs=2, methods=METHODS_RUN, first_seed=5, smoke=True)
    learned = {spec.name for spec in now if spec.method}
    assert learned
    assert not learned & before
    assert {spec.name for spec in now if not spec.method} <= before  # C4.5 chooses as it did


def test_a_refusal_is_a_record_with_its_reason_and_any_other_error_is_none(monkeypatch):
    settings = TASKS["cart-pole"].small()
    spec = FrameworkSpec(
        task="cart-pole", settings=settings, method="parti-game", arm=TREE_AND_DEMOS
    )
    record, _ = run(spec)
    assert record.refused.startswith("it needs a goal: a demonstration that reached it")
    assert record.curve == ()

    def broken(*arguments):
        raise InvalidArgumentError("episodes must be an integer >= 0, got -1")

    monkeypatch.setattr(framework, "method_for", broken)
    with pytest.raises(InvalidArgumentError, match="episodes must be"):
        run(spec)


def naive_for_good(scores, episodes, level):
    """Go backward from the end while the score holds."""
    found = []
    for curve in scores:
        place = len(curve)
        while place and curve[place - 1] >= level:
            place -= 1
        there = place < len(curve)
        found.append((episodes[place] if there else episodes[-1], there))
    return found


def test_for_good_is_the_first_evaluation_after_which_the_level_holds():
    episodes = np.array([0, 10, 20, 30])
    scores = np.array(
        [[1, 1, 1, 1], [1, 0, 1, 1], [0, 0, 0, 1], [1, 1, 1, 0], [0, 0, 0, 0]], dtype=float
    )
    times, reached = for_good(scores, episodes, 0.95)
    assert times.tolist() == [0, 20, 30, 30, 30]
    assert reached.tolist() == [True, True, True, False, False]
    drawn = np.random.default_rng(0).random((200, 4)) + 0.3
    times, reached = for_good(drawn, episodes, 0.95)
    assert list(zip(times.tolist(), reached.tolist(), strict=True)) == naive_for_good(
        drawn.tolist(), episodes.tolist(), 0.95
    )


def times_of(*episodes, reached=True, horizon=40, demonstrations=10):
    n = len(episodes)
    return Times(np.array(episodes, dtype=float), np.full(n, reached), horizon, demonstrations)


def test_the_ratio_is_of_mean_shares_of_the_horizons():
    taught = [times_of(10, 10), times_of(0, 0, horizon=80)]
    alone = [times_of(20, 20, demonstrations=0), times_of(80, 80, horizon=80, demonstrations=0)]
    ratio = ratio_of_times(taught, alone, fair=False)
    assert ratio.value == pytest.approx((10 / 40 + 0) / (20 / 40 + 1))
    assert ratio.interval == pytest.approx((ratio.value, ratio.value))
    fair = ratio_of_times(taught, alone, fair=True)
    assert fair.value == pytest.approx((20 / 40 + 10 / 80) / (20 / 40 + 1))
    nothing = [times_of(0, 0)]
    assert ratio_of_times(nothing, nothing, fair=False).value == 1.0


@pytest.mark.parametrize(
    ("interval", "learned", "expected"),
    [
        ((0.1, 0.4), False, HOLDS),  # nothing took at least as long as was seen
        ((0.1, 0.4), True, HOLDS),
        ((0.4, 0.6), True, OPEN),
        ((0.6, 0.9), True, FAILS),
        ((0.6, 0.9), False, OPEN),  # nothing never learned: its time is not known
    ],
)
@pytest.mark.parametrize("seeds", [4, 15])
def test_halving_is_judged_by_the_whole_interval(interval, learned, expected, seeds):
    estimate = Estimate(sum(interval) / 2, Interval(*interval), seeds)
    found = halved(estimate, [times_of(40, 40, reached=learned)])
    assert found == (expected if seeds >= 5 else OPEN)  # of so few nothing can be told


def record_of(task, method, arm, seed, returns, refused=""):
    """Return a record whose tree earned these returns at its evaluations."""
    spec = FrameworkSpec(task=task, settings=TASKS[task], method=method, arm=arm, seed=seed)
    curve = tuple(Evaluated(10 * i, r, None, 3) for i, r in enumerate(returns))
    return FrameworkRecord(spec=spec, curve=() if refused else curve, refused=refused)


SEEDS = 5


def invented(taught, alone, *, refused=""):
    """Return runs of two arms on two tasks whose frozen expert scores 1 and chance 0."""
    records = []
    for task in ("evasion", "cart-pole"):
        chance = TASKS[task].chance
        for seed in range(SEEDS):
            records.append(record_of(task, "", Arm(FROZEN), seed, [chance + 100.0]))
            for arm, scores in ((TREE_AND_DEMOS, taught), (NOTHING, alone)):
                says = refused if task == "cart-pole" else ""
                returns = [chance + 100.0 * s for s in scores]
                records.append(record_of(task, "vrd", arm, seed, returns, says))
    return Runs(records)


@pytest.mark.parametrize(
    ("taught", "alone", "holds", "ratio"),
    [
        ([1, 1, 1, 1, 1], [0, 0, 0, 0, 1], HOLDS, 0.0),
        ([0, 0, 0, 1, 1], [0, 0, 0, 0, 1], FAILS, 0.75),
        ([0, 0, 0, 1, 1], [0, 0, 0, 0, 0], OPEN, 0.75),
        ([1, 1, 0, 0, 0.94], [0, 1, 1, 1, 1], FAILS, 4.0),
    ],
)
def test_verdicts_on_learning_time_follow_from_the_curves(taught, alone, holds, ratio):
    found = verdict(invented(taught, alone), Expectation("vrd", HOLDS, "because"))
    assert found.holds == holds
    assert found.estimate.value == pytest.approx(ratio)
    assert found.tasks == ("evasion", "cart-pole")
    assert found.as_expected == {HOLDS: "yes", FAILS: "no", OPEN: "open"}[holds]


def test_verdicts_on_two_arms_follow_from_mean_scores():
    runs = invented([1, 1, 1, 1, 1], [0, 0, 0, 0, 1])
    above = verdict(runs, Expectation("vrd", HOLDS, "", TREE_AND_DEMOS, NOTHING))
    assert (above.holds, above.estimate.value) == (HOLDS, pytest.approx(0.8))
    below = verdict(runs, Expectation("vrd", HOLDS, "", NOTHING, TREE_AND_DEMOS))
    assert below.holds == FAILS
    alike = verdict(runs, Expectation("vrd", HOLDS, "", TREE_AND_DEMOS, NOTHING, similar=True))
    assert alike.holds == FAILS


def test_a_refused_task_is_left_out_of_the_verdict():
    expectation = Expectation("vrd", HOLDS, "")
    found = verdict(invented([1, 1, 1], [0, 0, 1], refused="it needs a goal"), expectation)
    assert found.tasks == ("evasion",)
    nothing_left = Finding(expectation, REFUSED, None, ())
    assert (nothing_left.as_expected, nothing_left.number) == ("open", "")
    records = [record_of("evasion", "", Arm(FROZEN, GOOD), 0, [1.0])]
    records += [
        record_of("evasion", "vrd", arm, 0, [], "no") for arm in (NOTHING, POOR_TREE_AND_DEMOS)
    ]
    harm = Expectation("vrd", HOLDS, "", NOTHING, POOR_TREE_AND_DEMOS)
    assert verdict(Runs(records), harm).holds == REFUSED


def test_the_command_runs_one_method_and_knows_the_others(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(framework, "TASKS", {"evasion": TASKS["evasion"]})
    line = ["reproduce", "framework", "--smoke", "--method", "u-tree", "--json", "--out", "r"]
    assert run_cli(line) == 0
    found = json.loads(capsys.readouterr().out)
    assert [v["method"] for v in found["verdicts"]] == ["u-tree"] * 3
    assert found["smoke"]
    assert "A smoke run" in (tmp_path / "r" / "framework.md").read_text()
    assert not framework.is_smoke(specs(runs=1, methods=("u-tree",)))
    assert run_cli(["reproduce", "framework", "--method", "utree"]) == 2
    assert "Did you mean 'u-tree'" in capsys.readouterr().err
