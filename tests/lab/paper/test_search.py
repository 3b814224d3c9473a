"""The search: what is decided is data, the distance is as written, the race drops the worse."""

import json
import shutil
from dataclasses import fields, replace
from itertools import combinations

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run as run_cli
from eutree.envs.experts import experts_for
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.learners import PAPER, PAPER_D
from eutree_lab.paper import results as results_module
from eutree_lab.paper import search_plan
from eutree_lab.paper.experiment import SMOKE
from eutree_lab.paper.finals import FINALS, Correct
from eutree_lab.paper.objective import (
    NUMBERS,
    Distance,
    cost,
    distance,
    nearest,
    shortened,
)
from eutree_lab.paper.runs import Performance, Point, RunRecord, RunSpec, run
from eutree_lab.paper.search import FRONTIER, Scored, Search, recorded_setting
from eutree_lab.paper.search_plan import SMOKE_PLAN
from eutree_lab.paper.search_space import CHOICES, COARSE, DOMAINS, FINE, choices_of, mutated
from eutree_lab.paper.search_table import exclusions, most_together, to_csv, to_markdown
from eutree_lab.paper.settings import Demonstrator, Domain, Reading, Setting

TWO, THREE = "eutree/Evasion2-v0", "eutree/Evasion3-v0"
TINY = replace(SMOKE, episodes=6, evaluate_every=3, evaluation_episodes=4, final_episodes=4)


# What is decided --------------------------------------------------------------------------------


def test_a_setting_that_spells_out_the_preset_does_what_the_preset_does():
    spec = TINY.spec(TWO, "eu-tree", "paper", 0)
    spelled = replace(spec, setting=Setting(reading=Reading()))
    assert spelled.name != spec.name
    plain, same = run(spec), run(spelled)
    assert (same.curve, same.final, same.finals) == (plain.curve, plain.final, plain.finals)
    assert Reading().method() == PAPER
    assert Reading(split="largest D").method() == PAPER_D


@pytest.mark.parametrize(
    "setting",
    [
        Setting(domain=Domain(time_step=0.5)),
        Setting(domain=Domain(start="either end")),
        Setting(domain=Domain(bounce="turn")),
        Setting(demonstrator=Demonstrator(wait_distance=3.0)),
        Setting(reading=Reading(untried="zero")),
    ],
)
def test_every_part_of_a_setting_decides_the_run(setting):
    base = TINY.spec(TWO, "eu-tree-dt", "paper", 0)
    changed = replace(base, setting=setting)
    assert changed.name != base.name
    first, second = run(base), run(changed)
    assert (first.curve, first.expert) != (second.curve, second.expert)


def test_the_name_of_a_run_without_a_setting_is_what_it_was():
    spec = RunSpec(environment=TWO, learner="eu-tree", preset="paper", seed=3)
    assert spec.name == "eu-tree-paper-03-be58d8a1334c"


def test_a_person_s_demonstrations_are_taken_from_their_folder(tmp_path):
    folder = tmp_path / "person"
    env = gymnasium.make(TWO)
    shown = eutree.record(env, eutree.experts.look_ahead, episodes=4, seed=1, out=folder)
    setting = Setting(demonstrator=Demonstrator.recorded(folder))
    spec = replace(TINY.spec(TWO, "expert", "", 0), setting=setting)
    found = run(spec)
    assert found.expert.n_leaves == eutree.fit_expert_tree(shown).n_leaves
    other = replace(setting.demonstrator, digest="0" * 64)
    with pytest.raises(InvalidArgumentError, match="must hold the demonstrations of digest 0000"):
        run(replace(spec, setting=Setting(demonstrator=other)))


def test_a_wrong_reading_is_an_error():
    with pytest.raises(UnknownNameError, match="untried 'labels'"):
        Reading(untried="labels")
    with pytest.raises(UnknownNameError, match="split 'largest'"):
        Reading(split="largest")


# Final policies ---------------------------------------------------------------------------------


def curve(*success):
    return [Point(20 * i, s, 100 * s, 10 + i) for i, s in enumerate(success)]


def test_final_policies_by_hand():
    points = curve(1.0, 0.9, 0.96, 0.97, 0.5)
    chosen = {name: rule(points) for name, rule in FINALS.items()}
    assert chosen == {
        "best": 3, "last": 4, "95 % once": 2, "95 % twice": 3, "95 % three times": 4,
        "95 % four times": 4, "all once": 4, "all twice": 4, "all three times": 4,
    }  # fmt: skip
    assert FINALS["best"](curve(0.5, 0.8, 0.8)) == 1
    assert Correct(success=0.9, evaluations=2)(curve(1.0, 0.95, 0.5, 0.95, 0.95)) == 4


def test_the_final_policies_of_a_run_are_those_of_its_curve():
    found = run(TINY.spec(TWO, "eu-tree", "paper", 0))
    for name, rule in FINALS.items():
        assert found.finals[name].n_leaves == found.curve[rule(found.curve)].n_leaves
    assert found.finals["last"] == found.final


# The distance -----------------------------------------------------------------------------------


def record_of(domain, learner, *, speed=3.2, success=(0.5, 0.9), states=10, reward=80.0, seed=0):
    spec = RunSpec(environment=domain, learner=learner, preset="", opponent_speed=speed, seed=seed)
    final = Performance(success[-1], reward, states)
    expert = None if learner == "c-u-tree" else Performance(success[0], reward, states)
    return RunRecord(
        spec=spec,
        expert=expert,
        curve=[] if learner == "expert" else curve(*success),
        final=final,
        compressed=None if learner == "expert" else Performance(0.5, 1.0, states // 5),
        agreement=None,
        finals=dict.fromkeys(FINALS, final),
    )


def as_the_paper_has_it():
    """Return one record of each kind, with the numbers of the paper."""
    records = [
        record_of(TWO, "expert", speed=v, success=(s,), states=9, reward=82.0)
        for v, s in ((2.2, 1.0), (3.2, 1.0), (4.2, 0.5))
    ]
    records.append(record_of(THREE, "expert", success=(1.0,)))
    for domain in (TWO, THREE):
        slow = (0.1, 0.5, 0.95, 1.0)
        fast = (0.9, 1.0, 1.0, 1.0)
        records.append(record_of(domain, "c-u-tree", success=slow, states=167, reward=50.0))
        records.append(record_of(domain, "eu-tree-dt", success=fast, states=30))
        records.append(record_of(domain, "eu-tree", success=fast, states=30))
    for speed, far in ((2.2, (0.8, 0.9, 1.0, 1.0)), (4.2, (0.5, 0.7, 0.9, 1.0))):
        records.append(record_of(TWO, "eu-tree", speed=speed, success=far))
    return records


def test_the_paper_s_own_numbers_are_at_no_distance():
    found = distance(as_the_paper_has_it(), "last")
    assert set(found.ours) == {number.name for number in NUMBERS}
    assert {name: c for name, c in found.costs.items() if c} == {}
    assert found.ours["C. U-Tree: states"] == 167
    assert found.ours["expert tree: success at 4.2 m/s"] == 0.5
    assert found.ours["compression"] == pytest.approx((33 / 167 + 6 / 30) / 2)
    assert found.n_agreeing == len(NUMBERS)


def test_each_number_costs_when_it_is_far():
    """Every number notices: a set of records in which everything is wrong costs everywhere."""
    records = [
        record_of(TWO, "expert", speed=v, success=(s,), states=30, reward=20.0)
        for v, s in ((2.2, 0.5), (3.2, 0.5), (4.2, 1.0))
    ]
    records.append(record_of(THREE, "expert", success=(0.5,)))
    for domain in (TWO, THREE):
        records.append(
            record_of(domain, "c-u-tree", success=(0.0, 0.95, 0.8), states=8, reward=70.0)
        )
        records.append(record_of(domain, "eu-tree-dt", success=(0.1, 0.1, 0.1)))
        records.append(record_of(domain, "eu-tree", success=(0.3, 0.3, 0.5), states=5, reward=30.0))
    for speed, far in ((2.2, (0.2, 0.95, 0.95)), (4.2, (0.1, 0.9, 0.0))):
        records.append(record_of(TWO, "eu-tree", speed=speed, success=far))
    records = [
        r if r.compressed is None else replace_compressed(r, r.final.n_leaves) for r in records
    ]
    costs = distance(records, "last").costs
    assert {name for name, c in costs.items() if c == 0.0} == set()


def replace_compressed(record, n_leaves):
    return RunRecord(
        spec=record.spec, expert=record.expert, curve=record.curve, final=record.final,
        compressed=Performance(0.5, 1.0, n_leaves), agreement=None, finals=record.finals,
    )  # fmt: skip


def test_a_cost_grows_with_the_misses_up_to_three():
    states = next(n for n in NUMBERS if n.name == "C. U-Tree: states")
    assert [cost(states, v) for v in (117, 217, 167)] == [0.0, 0.0, 0.0]
    assert cost(states, 267) == cost(states, 67) == pytest.approx(0.25 + 0.75 / 3)
    assert cost(states, 10_000) == 1.0


def test_what_cannot_be_told_is_left_out():
    only = [record_of(TWO, "expert", success=(1.0,), states=9, reward=82.0)]
    assert set(distance(only, "last").costs) == {
        "expert tree: states", "expert tree: reward", "expert tree: success in 2-Evasion",
    }  # fmt: skip
    assert nearest(only)[1].mean == 0.0


def test_an_older_record_has_its_final_policies_along_the_curve():
    old = RunRecord(
        spec=RunSpec(environment=TWO, learner="c-u-tree", preset="paper"), expert=None,
        curve=curve(0.5, 0.6), final=Performance(0.6, 1.0, 3), compressed=None, agreement=None,
    )  # fmt: skip
    found = distance([old], "best").ours
    assert (found["C. U-Tree: states"], found["C. U-Tree: reward"]) == (11, 60)


# The race ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("search")
    plan = replace(SMOKE_PLAN, domains=3, scale=TINY)
    return folder, plan, Search(folder, plan=plan).run()


def test_a_search_goes_through_all_stages_and_ranks_all_settings(searched):
    _, _, scored = searched
    assert {one.stage for one in scored} >= {"expert", "neighbours", "speeds"}
    assert scored[0].stage == "speeds"
    assert set(scored[0].distance.costs) == {number.name for number in NUMBERS}
    assert len({one.setting for one in scored}) == len(scored)


def test_between_two_numbers_those_settings_are_changed_that_miss_both_by_least(searched):
    """Learned in is the nearest to both, by a sum made here; and as many were made as asked."""
    _, plan, scored = searched
    plain = [one for one in scored if one.setting.reading is None]
    missed = [sum(one.distance.costs[name] for name in FRONTIER) for one in plain]
    made = [one.setting for one in plain if one.stage == "frontier"]
    assert sum(plan.frontier) <= len(made) <= sum(plan.frontier) + 1  # and the one learned in
    learned = {replace(one.setting, reading=None) for one in scored if one.setting.reading}
    assert learned & {
        one.setting for one, miss in zip(plain, missed, strict=True) if miss == min(missed)
    }


def begun_before(folder, other):
    """Copy a search without every sixth of its runs; return the names of those."""
    names = sorted(path.name for path in (folder / "runs").iterdir())
    shutil.copytree(folder / "runs", other / "runs")
    for name in names[::6]:
        (other / "runs" / name).unlink()
    return names[::6]


def test_an_interrupted_search_goes_on_with_what_is_missing(searched, tmp_path, monkeypatch):
    folder, plan, scored = searched
    whole = {p.name: p.read_bytes() for p in (folder / "runs").iterdir()}
    missing = begun_before(folder, tmp_path)
    done = []

    def counted(spec):
        done.append(spec)
        return run(spec)

    monkeypatch.setattr(results_module, "run", counted)
    again = Search(tmp_path, plan=plan).run()
    assert again == scored
    assert len(done) == len(missing) >= 4
    assert {p.name: p.read_bytes() for p in (tmp_path / "runs").iterdir()} == whole


def test_the_clearly_worse_are_dropped():
    """By hand: B is behind A by the same on every seed, C is as good."""
    settings = [Setting(demonstrator=Demonstrator(wait_distance=w)) for w in (1.0, 2.0, 3.0)]

    class ByHand(Search):
        def __init__(self):
            pass

        def _miss(self, setting):
            return float(np.mean(self._by_seed(setting, range(3))))

        def _by_seed(self, setting, seeds):
            noise = np.array([0.1, 0.2, 0.15])[: len(seeds)]
            turned = noise[::-1]
            at = settings.index(setting)
            return (noise, noise + 0.3, turned + 0.001)[at]

    kept = ByHand()._not_clearly_worse(settings, 7002)
    assert kept == [settings[0], settings[2]]


@pytest.mark.parametrize("seed", range(5))
def test_a_neighbour_differs_in_one_choice(seed):
    generator = np.random.default_rng(seed)
    for setting in (Setting(), Setting(reading=Reading())):
        changed = mutated(setting, generator, FINE if seed % 2 == 0 else COARSE)
        before, after = choices_of(setting), choices_of(changed)
        assert sum(before[name] != after[name] for name in before) == 1
    person = Setting(demonstrator=Demonstrator(folder="x", digest="y"), reading=Reading())
    changed = mutated(person, generator)
    assert (changed.domain, changed.demonstrator) == (person.domain, person.demonstrator)


def test_the_space_holds_what_the_choices_are_called():
    assert set(DOMAINS) <= {field.name for field in fields(Domain)}
    assert set(CHOICES) == set(choices_of(Setting(reading=Reading())))


def test_the_tables_hold_every_setting_and_every_number(searched):
    _, _, scored = searched
    rows = to_csv(scored).splitlines()
    assert len(rows) == 1 + len(scored)
    assert rows[1].startswith(f"1,{scored[0].setting.domain.time_step},")
    text = to_markdown(scored)
    assert all(number.name in text for number in NUMBERS)
    assert "Which numbers exclude which" in text


def test_the_command_searches_in_small(searched, tmp_path, capsys, monkeypatch):
    folder, plan, scored = searched
    monkeypatch.setattr(search_plan, "SMOKE_PLAN", plan)
    missing = begun_before(folder, tmp_path / "r")
    line = ["reproduce", "search", "--smoke", "--json", "--out", str(tmp_path / "r")]
    assert run_cli(line) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["settings"][0]["stage"] == "speeds"
    assert len(to_csv(scored).splitlines()) == len(
        (tmp_path / "r/search.csv").read_text().splitlines()
    )
    assert all((tmp_path / "r" / "runs" / name).exists() for name in missing)
    assert (tmp_path / "r" / "search.csv").stat().st_size > 1000
    page = (tmp_path / "r" / "search.md").read_text(encoding="utf-8")
    assert page.startswith("**A smoke run")
    assert "The nearest settings" in page
    assert run_cli(["reproduce", "--list", "--json"]) == 0
    assert "search" in json.loads(capsys.readouterr().out)


# Which numbers can agree together ---------------------------------------------------------------


def scored_by(*agreeing, told=NUMBERS):
    """Return settings that agree in the named numbers, by index in the list of all."""
    found = []
    for place, names in enumerate(agreeing):
        costs = {n.name: float(i not in names) for i, n in enumerate(told)}
        setting = Setting(demonstrator=Demonstrator(wait_distance=float(place)))
        found.append(Scored(setting, "speeds", 1, "last", Distance(dict(costs), costs)))
    return found


def test_the_most_that_can_agree_at_once_by_hand():
    """0 and 1 agree together, 2 with 1 alone, 3 with none of them, the others nowhere."""
    scored = scored_by({0, 1}, {1, 2}, {3})
    names = [number.name for number in NUMBERS]
    assert set(exclusions(scored)) == {
        (names[0], names[2]), (names[0], names[3]), (names[1], names[3]), (names[2], names[3])
    }  # fmt: skip
    assert len(most_together(scored)) == 2
    assert names[3] not in most_together(scored)


@pytest.mark.parametrize("seed", range(5))
def test_the_most_that_can_agree_at_once_is_that_of_all_subsets(seed):
    generator = np.random.default_rng(seed)
    some = 7
    scored = scored_by(*(set(np.flatnonzero(generator.random(some) < 0.4)) for _ in range(4)))
    names = [number.name for number in NUMBERS[:some]]
    apart = set(exclusions(scored))
    agree = {n for n in names if any(s.distance.costs[n] == 0.0 for s in scored)}
    best = max(
        size
        for size in range(some + 1)
        for chosen in combinations(sorted(agree, key=names.index), size)
        if not any(pair in apart for pair in combinations(chosen, 2))
    )
    found = most_together(scored)
    assert len(found) == best
    assert not any(set(pair) <= found for pair in apart)


# Choices that came later ------------------------------------------------------------------------


def test_later_choices_at_their_defaults_leave_a_run_its_name():
    spec = replace(TINY.spec(TWO, "expert", "", 0), setting=Setting())
    assert spec.name == "expert-c45-00-252f1e53b615"
    for setting in (
        Setting(domain=Domain(spacing=0.8)),
        Setting(domain=Domain(shift=1.0)),
        Setting(demonstrator=Demonstrator(rule="look ahead")),
    ):
        assert replace(spec, setting=setting).name != spec.name


def test_crossings_by_hand():
    assert Domain().crossings(2) == (10.0, 20.0)
    assert Domain(spacing=0.8, shift=1.0).crossings(3) == pytest.approx((10.0, 16.0, 22.0))
    assert "crossings" not in Domain().arguments(2)
    assert Domain(shift=1.0).arguments(2)["crossings"] == (11.0, 21.0)


def test_a_person_s_setting_has_the_domain_of_the_recording(tmp_path):
    env = gymnasium.make("eutree/PaperEvasion2-v0", noise=0.03)
    eutree.record(env, eutree.experts.look_ahead, episodes=2, seed=1, out=tmp_path / "person")
    domain = recorded_setting(tmp_path / "person").domain
    assert (domain.start, domain.collision_distance, domain.noise) == ("either end", 1.0, 0.03)
    balance = experts_for("CartPole-v1")["balance"]
    other = eutree.record(gymnasium.make("CartPole-v1"), balance, episodes=1, seed=0)
    other.save(tmp_path / "other")
    with pytest.raises(InvalidArgumentError, match="must be of 2-Evasion"):
        recorded_setting(tmp_path / "other")


def test_a_shorter_run_is_the_beginning_of_a_longer_one():
    setting = Setting(reading=Reading(gathering_episodes=3))
    whole = run(replace(TINY.spec(TWO, "eu-tree", "paper", 0), setting=setting))
    begin = run(replace(whole.spec, episodes=3))
    cut = shortened(whole, 3)
    assert cut.curve == begin.curve
    assert cut.final.n_leaves == begin.final.n_leaves
    assert shortened(whole, 6) is whole
