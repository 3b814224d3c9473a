"""The light of examples/traffic_light, with traffic of a few lines; and with SUMO where it is."""

from importlib.util import find_spec
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from examples.traffic_light import COLOGNE, INGOLSTADT, FixedCycle
from examples.traffic_light.light import Episode, Junction, TrafficLight, amber
from examples.traffic_light.sumo import options_of
from gymnasium.utils.env_checker import check_env

import eutree
from eutree.features import Derivation
from eutree.inspection import enforce, verify
from eutree.interaction import describe
from eutree.trees import DecisionTree
from examples import traffic_light

JUNCTION = Junction("here", "light", 100, ("a", "b"), (("x", "y"), ("y", "z")))
SIGNALS = ["GGr", "rGG"]
HAS_SUMO = all(find_spec(name) is not None for name in ("sumo_rl", "libsumo"))


class FewVehicles:
    """One vehicle more stands in x for every ten seconds that it is red; none elsewhere."""

    def start(self, episode):
        self.episode, self.log, self.red, self.over = episode, [], 0, False
        return {"signals": SIGNALS, "amber": 3, **self._counts()}

    def show(self, shown):
        standing = 0.0
        for signals, seconds in shown:
            self.log.append((signals, seconds))
            self.red = 0 if signals is not None and signals[0] == "G" else self.red + seconds
            standing += self._counts()["waiting"][0] * seconds
        return {"standing": standing, **self._counts()}

    def finish(self):
        self.over = True
        return {"delay": 1.0, "longest_wait": 2.0}

    def stop(self):
        self.over = True

    def _counts(self):
        return {"waiting": [self.red // 10, 0, 0], "coming": [1, 2, 4]}


def light(**options):
    traffic = FewVehicles()
    return TrafficLight(JUNCTION, traffic, **options), traffic


def test_amber_shows_what_was_green_and_will_be_red():
    assert amber("GGggrr", "rGgrGg") == "yGgyrr"


def test_a_change_costs_the_amber_of_the_plan_and_the_least_green():
    env, traffic = light()
    env.reset(seed=0)
    env.step(0)
    env.step(1)
    env.step(1)
    assert traffic.log == [("GGr", 5), ("yGr", 3), ("rGG", 5), ("rGG", 5)]


def test_the_amber_can_be_another_than_that_of_the_plan():
    env, traffic = light(amber=2)
    env.reset(seed=0)
    env.step(1)
    assert traffic.log == [("yGr", 2), ("rGG", 5)]


def test_what_is_seen_counts_lanes_and_seconds():
    env, _ = light()
    first, _ = env.reset(seed=0)
    assert first.tolist() == [0, 0, 3, 6, 1, 0, 0, 0, 0]
    env.step(1)
    env.step(1)
    seen, reward, *_ = env.step(1)
    named = dict(zip(env.feature_names, seen, strict=True))
    assert named["waiting for a"] == 1
    assert (named["green a"], named["green b"]) == (0, 1)
    assert (named["red for a"], named["red for b"], named["unchanged for"]) == (18, 0, 15)
    assert reward == pytest.approx(-5 * 1 / 1800)


def test_an_episode_ends_on_the_second_with_its_figures():
    env, traffic = light(seconds=21)
    env.reset(seed=0)
    actions, over, info = [1, 1, 0, 0], False, {}
    taken = 0
    while not over:
        _, _, terminated, over, info = env.step(actions[taken])
        assert not terminated
        taken += 1
    assert sum(seconds for _, seconds in traffic.log) == 21
    assert traffic.over
    assert (info["delay"], info["longest_wait"], info["seconds"]) == (1.0, 2.0, 8)


def test_each_morning_has_a_demand_of_its_own_unless_it_is_given():
    env, traffic = light()
    demands = []
    for seed in range(20):
        env.reset(seed=seed)
        demands.append(traffic.episode.demand)
    assert len(set(demands)) == 20
    assert all(0.8 <= demand <= 1.2 for demand in demands)
    env, traffic = light(demand=1.1)
    env.reset(seed=0)
    assert traffic.episode.demand == 1.1


def test_red_does_not_tell_the_time_of_day():
    env, _ = light()
    env.reset(seed=0)
    for _ in range(40):
        seen, *_ = env.step(0)
    assert dict(zip(env.feature_names, seen, strict=True))["red for b"] == 120
    assert env.observation_space.contains(seen)


def test_a_programme_of_its_own_ignores_the_actions():
    env, traffic = light(program="plan")
    env.reset(seed=0)
    env.step(1)
    assert traffic.log == [(None, 5)]


def test_seeds_have_31_bits_and_are_drawn_from_that_of_the_episode():
    env, traffic = light()
    seeds = []
    for seed in (0, 1, 2**32 - 1, 0):
        env.reset(seed=seed)
        seeds.append(traffic.episode.seed)
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert seeds[0] == seeds[3] != seeds[1]


@pytest.mark.filterwarnings("ignore:.*WARN.*:UserWarning")
@pytest.mark.parametrize("junction", [COLOGNE, INGOLSTADT])
def test_it_keeps_gymnasiums_contract(junction):
    class Still(FewVehicles):
        def start(self, episode):
            super().start(episode)
            return {"signals": ["G"] * len(junction.phases), "amber": 3, **self._counts()}

        def _counts(self):
            return dict.fromkeys(("waiting", "coming"), [0] * len(junction.all_lanes))

    env = TrafficLight(junction, Still())
    check_env(env, skip_render_check=True)
    assert len(env.feature_names) == len(env.feature_units) == env.observation_space.shape[0]
    assert len(set(env.feature_names)) == len(env.feature_names)


def test_a_tree_speaks_of_phases_and_seconds():
    env, _ = light(seconds=600)
    shown = eutree.record(env, FixedCycle(seconds=10), episodes=2, seed=0)
    assert shown.schema.actions == ("a", "b")
    text = str(eutree.fit_expert_tree(shown))
    assert "green is a" in text
    assert "unchanged for" in text


def seen(waiting, coming, green, since):
    return np.array([*waiting, *coming, *np.eye(len(waiting))[green], *[0] * len(waiting), since])


def test_the_longest_queue_is_served_and_a_tie_changes_nothing():
    assert traffic_light.longest_queue(seen([1, 3, 2], [9, 0, 0], 0, 5)) == 1
    assert traffic_light.longest_queue(seen([3, 3, 2], [0, 9, 0], 0, 5)) == 0


def test_resco_s_controllers_decide_every_ten_seconds():
    early, late = (seen([0, 1, 0], [0, 0, 3], 0, since) for since in (5, 10))
    assert [traffic_light.max_pressure(o) for o in (early, late)] == [0, 1]
    assert [traffic_light.max_wave(o) for o in (early, late)] == [0, 2]


def test_a_fixed_cycle_takes_one_phase_after_the_other():
    cycle = FixedCycle(seconds=10)
    answers = [int(cycle.predict(seen([0, 0, 0], [9, 9, 9], green, since))[0])
               for green, since in ((0, 5), (0, 10), (2, 10))]  # fmt: skip
    assert answers == [0, 1, 0]


def test_the_command_line_of_sumo_says_what_is_played(tmp_path):
    options = options_of(Episode(JUNCTION, 1800, 1.2, "none", 7), tmp_path)
    pairs = dict(zip(options[::2], options[1::2], strict=False))
    assert (pairs["--seed"], pairs["--scale"], pairs["-b"]) == ("7", "1.2", "100")
    assert pairs["-n"] == str(tmp_path / "here.net.xml")


@pytest.mark.skipif(not HAS_SUMO, reason="SUMO is not installed")
@pytest.mark.parametrize("name", ["Cologne1-v0", "Ingolstadt1-v0"])
def test_sumo_plays_both_junctions(name):
    env = gymnasium.make(name, seconds=120)
    observation, _ = env.reset(seed=1)
    over, info = False, {}
    while not over:
        action = traffic_light.max_pressure(observation)
        observation, reward, _, over, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert reward <= 0.0
    assert info["delay"] > 0.0


@pytest.mark.skipif(not HAS_SUMO, reason="SUMO is not installed")
@pytest.mark.parametrize("program", ["plan", "actuated"])
def test_sumo_plays_the_programmes_of_the_net(program):
    env = gymnasium.make("Cologne1-v0", seconds=300, program=program)
    returns = []
    for action in (0, 2):
        env.reset(seed=1)
        total, over = 0.0, False
        while not over:
            _, reward, _, over, _ = env.step(action)
            total += reward
        returns.append(total)
    assert returns[0] == pytest.approx(returns[1], rel=0.2)
    assert returns[0] < 0.0


@pytest.mark.skipif(not HAS_SUMO, reason="SUMO is not installed")
def test_an_episode_that_another_has_ended_says_so():
    one, two = (gymnasium.make("Cologne1-v0", seconds=60) for _ in range(2))
    one.reset(seed=1)
    two.reset(seed=1)
    with pytest.raises(RuntimeError, match="one episode at a time"):
        one.step(0)
    two.close()


@pytest.mark.parametrize("junction", [COLOGNE, INGOLSTADT])
def test_its_differences_are_of_all_vehicles_and_disturb_no_rule_of_thumb(junction):
    name = f"{junction.name.capitalize()}-v0"
    plain = TrafficLight(junction, FewVehicles())
    n = len(junction.phases)
    derivation = Derivation.of(describe(plain).derive(traffic_light.DERIVED[name]))
    measured = seen(range(n), [10 * k for k in range(n)], 0, 10)
    derived = derivation.rows(measured, None)
    assert derived[4 * n + 1] == 22  # the third phase's less the first's
    for rule in (traffic_light.longest_queue, traffic_light.max_pressure, traffic_light.max_wave):
        assert rule(derived) == rule(measured)


@pytest.mark.parametrize("junction", [COLOGNE, INGOLSTADT])
def test_its_two_rules_hold_above_any_tree(junction):
    schema = describe(TrafficLight(junction, FewVehicles()))
    rules = traffic_light.RULES[f"{junction.name.capitalize()}-v0"]
    tree = DecisionTree.single_leaf(schema.n_features)
    always = eutree.TreePolicy(tree, np.array([1]), schema)
    assert not all(verify(always, rule).holds for rule in rules)
    ruled = enforce(always, rules).policy
    assert all(verify(ruled, rule).holds for rule in rules)
    assert ruled.n_leaves == always.n_leaves + 2


def test_the_tree_of_the_page_is_the_file_and_keeps_the_two_rules():
    folder = Path(traffic_light.__file__).parent
    tree = eutree.TreePolicy.load(folder / "light.json")
    assert all(verify(tree, rule).holds for rule in traffic_light.RULES["Cologne1-v0"])
    assert str(tree).split("\nwhere ")[0] in (folder / "README.md").read_text(encoding="utf-8")
