"""The public ``learn``: methods and starts, the protocol, histories, interruptions."""

import dataclasses

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Episode
from eutree.errors import EnvironmentFault, InvalidArgumentError, RunFolderError
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import Stream
from eutree.learners import PAPER
from eutree.learners.history import TERMINAL
from eutree.schema import Schema
from tests.interaction.sick import Healthy
from tests.worlds import FEW_IMAGINED

SHORT = {"episodes": 30, "evaluate_every": 10, "evaluation_episodes": 10, "front_steps": 0}


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("eutree/Evasion2-v0")


@pytest.fixture(scope="module")
def demonstrations(env):
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=8, seed=0)


def same(first, second):
    """Return whether two runs ended the same, to the byte."""
    columns = ("observations", "actions", "rewards", "left", "entered")
    return (
        first.policy == second.policy
        and first.curve == second.curve
        and all(
            getattr(first.history, c).tobytes() == getattr(second.history, c).tobytes()
            for c in columns
        )
    )


def test_the_start_follows_from_what_is_given(env, demonstrations):
    expert = eutree.fit_expert_tree(demonstrations)
    with_all = eutree.learn(env, demonstrations=demonstrations, **SHORT)
    with_tree = eutree.learn(env, expert=expert, **SHORT)
    with_nothing = eutree.learn(env, **SHORT)
    names = [result.start for result in (with_all, with_tree, with_nothing)]
    assert names == ["tree+demos", "tree", "nothing"]
    assert with_all.history.size > with_all.steps == with_all.curve[-1].steps
    assert with_tree.history.size == with_tree.steps
    assert with_nothing.expert is None
    assert [point.episode for point in with_all.curve] == [0, 10, 20, 30]
    assert with_all.expert == expert


class Lengthens(Healthy):
    """Episode k of a run takes 5 (k + 1) steps, and nothing says so."""

    def reset(self, *, seed=None, options=None):
        seeds = [episode_seed(0, number, Stream.TRAINING) for number in range(9)]
        self.length = 5 + 5 * (seeds.index(seed) if seed in seeds else 0)
        return super().reset(seed=seed)

    def step(self, action):
        observation, reward, *_ = super().step(action)
        return np.minimum(observation, 1.0), reward, self.count == self.length, False, {}


@pytest.mark.parametrize(
    ("steps", "lengths"),
    [(1, [1]), (5, [5]), (9, [5]), (11, [5, 6]), (15, [5, 10]), (26, [5, 10, 11])],
)
def test_a_budget_of_steps_is_never_exceeded_where_no_limit_is_known(steps, lengths):
    """One that outgrows the budget is cut short, which is no end of the task."""
    result = eutree.learn(
        Lengthens(), method="paper", steps=steps, evaluate_every=99, evaluation_episodes=1
    )
    assert np.bincount(result.history.episodes).tolist() == lengths
    assert result.environment_steps.total == sum(lengths)
    whole = lengths[-1] == 5 * len(lengths)
    assert (result.history.entered == TERMINAL).sum() == len(lengths) - (not whole)


@pytest.mark.parametrize("steps", [1, 40, 200])
@pytest.mark.parametrize("share", [0, 0.5])
def test_a_budget_of_steps_holds_in_evasion_whose_spec_has_no_limit(
    env, demonstrations, steps, share
):
    """``--steps 1`` took 17 steps, and 33 with a race."""
    result = eutree.learn(
        env,
        demonstrations=demonstrations,
        steps=steps,
        race_steps=int(share * steps),
        evaluate_every=99,
        evaluation_episodes=2,
        method=FEW_IMAGINED,
    )
    counts = result.environment_steps
    assert 0 < counts.learning + counts.racing <= steps
    assert counts.learning == result.history.size - demonstrations.n_transitions


@pytest.mark.parametrize("method", ["paper", FEW_IMAGINED], ids=["paper", "default"])
def test_a_run_that_is_resumed_goes_as_far_as_it_was_to_go(env, tmp_path, method):
    options = {"method": method, "evaluate_every": 5, "evaluation_episodes": 2}
    calls = iter(range(10**9))
    stopped = eutree.learn(
        env, out=tmp_path / "a", episodes=12, stop=lambda: next(calls) > 60, **options
    )
    assert stopped.episodes < 12
    resumed = eutree.learn(env, out=tmp_path / "a", resume=True, **options)
    assert resumed.episodes == 12
    assert same(resumed, eutree.learn(env, episodes=12, **options))


@pytest.mark.parametrize("method", ["paper", FEW_IMAGINED], ids=["paper", "default"])
def test_the_same_seed_gives_the_same_result(env, demonstrations, method):
    runs = [
        eutree.learn(env, demonstrations=demonstrations, method=method, seed=seed, **SHORT)
        for seed in (3, 3, 4)
    ]
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])


@pytest.mark.promise(14)
def test_global_random_state_is_neither_read_nor_changed(env, demonstrations):
    results = []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002 - the global state is what is tested
        before = np.random.get_state()[1].tolist()  # noqa: NPY002 - as above
        results.append(
            eutree.learn(env, demonstrations=demonstrations, method=FEW_IMAGINED, **SHORT)
        )
        assert np.random.get_state()[1].tolist() == before  # noqa: NPY002 - as above
    assert same(*results)


def test_previous_observations_become_features(env, demonstrations):
    result = eutree.learn(
        env, demonstrations=demonstrations, method=FEW_IMAGINED, history=2, **SHORT
    )
    policy = result.policy
    assert (policy.history, policy.tree.n_features, policy.observation_size) == (2, 9, 3)
    assert policy.schema.feature_names[3] == "position, 1 ago"
    guarded = GuardedEnv(env, history=2)
    features, state = guarded.reset(seed=5), None
    for _ in range(15):
        action, state = policy.predict(features[:3], state)
        np.testing.assert_array_equal(state, features)
        assert action == policy.act(features.tolist())
        features, _, terminated, truncated, _ = guarded.step(action)
        if terminated or truncated:
            break
    assert eutree.evaluate(policy, env, episodes=5).n_leaves == policy.n_leaves


class InterruptedRunError(Exception):
    """Stands for whatever ends a process."""


@pytest.mark.promise(8)
@pytest.mark.parametrize("method", ["paper", FEW_IMAGINED], ids=["paper", "default"])
@pytest.mark.parametrize("at", [0, 1, 7, 20, 29])
def test_a_run_resumed_after_an_interruption_ends_the_same(
    env, demonstrations, tmp_path, method, at
):
    options = {"demonstrations": demonstrations, "method": method, "seed": 9, **SHORT}

    def interrupt(run):
        if run.episode == at:
            raise InterruptedRunError

    with pytest.raises(InterruptedRunError):
        eutree.learn(env, out=tmp_path / "run", on_progress=interrupt, **options)
    resumed = eutree.learn(env, out=tmp_path / "run", resume=True, **options)
    whole = eutree.learn(env, out=tmp_path / "whole", **options)
    assert same(resumed, whole)
    for name in (
        "policy.json",
        "expert.json",
        "curve.csv",
        "progress.csv",
        "events.jsonl",
        "checkpoint.npz",
    ):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.promise(8)
@pytest.mark.parametrize("method", ["paper", FEW_IMAGINED], ids=["paper", "default"])
@pytest.mark.parametrize("at", [1, 20])
def test_a_bounded_run_resumed_ends_the_same(env, demonstrations, tmp_path, method, at):
    options = {"demonstrations": demonstrations, "method": method, "max_transitions": 250, **SHORT}

    def interrupt(run):
        if run.episode == at:
            raise InterruptedRunError

    with pytest.raises(InterruptedRunError):
        eutree.learn(env, out=tmp_path / "run", on_progress=interrupt, **options)
    resumed = eutree.learn(env, out=tmp_path / "run", resume=True, **options)
    whole = eutree.learn(env, out=tmp_path / "whole", **options)
    assert 100 < whole.history.size <= 250 < whole.steps
    assert same(resumed, whole)
    for name in ("policy.json", "curve.csv", "events.jsonl", "checkpoint.npz"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    with pytest.raises(RunFolderError, match="cannot be resumed"):
        eutree.learn(env, out=tmp_path / "run", resume=True, **{**options, "max_transitions": 251})


def test_a_request_to_stop_ends_the_run_at_the_last_finished_episode(env, demonstrations, tmp_path):
    calls = iter(range(10**9))
    options = {"demonstrations": demonstrations, "method": FEW_IMAGINED, "seed": 2, **SHORT}
    stopped = eutree.learn(env, out=tmp_path / "a", stop=lambda: next(calls) >= 200, **options)
    assert 0 < stopped.episodes < 30
    resumed = eutree.learn(env, out=tmp_path / "a", resume=True, **options)
    assert same(resumed, eutree.learn(env, **options))


def test_a_fault_of_the_environment_leaves_the_run_resumable(tmp_path):
    class Breaks(Healthy):
        broken = True
        calls = 0

        def step(self, action):
            Breaks.calls += 1
            if self.broken and Breaks.calls == 23:
                return np.array([np.nan, 0.0]), 0.0, False, False, {}
            return super().step(action)

    options = {"episodes": 10, "evaluate_every": 100, "evaluation_episodes": 1, "seed": 1}
    options["front_steps"] = 0
    with pytest.raises(EnvironmentFault, match="finite"):
        eutree.learn(Breaks(), out=tmp_path / "a", **options)
    Breaks.broken = False
    resumed = eutree.learn(Breaks(), out=tmp_path / "a", resume=True, **options)
    assert same(resumed, eutree.learn(Breaks(), **options))


def test_a_run_folder_refuses_a_second_run_and_another_start(env, demonstrations, tmp_path):
    options = {"demonstrations": demonstrations, "out": tmp_path / "a", **SHORT}
    eutree.learn(env, seed=1, **options)
    with pytest.raises(RunFolderError, match="already holds a run; go on with it"):
        eutree.learn(env, seed=1, **options)
    with pytest.raises(RunFolderError, match=r"started with seed 1.*cannot be resumed with 2"):
        eutree.learn(env, seed=2, resume=True, **options)
    options["demonstrations"] = dataclasses.replace(
        demonstrations, episodes=demonstrations.episodes[1:]
    )
    message = "started with demonstrations that are not those given now, so .* resumed with these$"
    with pytest.raises(RunFolderError, match=message):
        eutree.learn(env, seed=1, resume=True, **options)


@pytest.mark.parametrize("start", ["tree+demos", "nothing"])
def test_a_finished_run_can_be_made_longer(env, demonstrations, tmp_path, start):
    """The front of the shorter run is no front of the longer one."""
    options = {"evaluation_episodes": 5, "evaluate_every": 20, "front_steps": 20_000}
    options |= {} if start == "nothing" else {"demonstrations": demonstrations}
    eutree.learn(env, out=tmp_path / "a", episodes=20, **options)
    longer = eutree.learn(env, out=tmp_path / "a", resume=True, episodes=40, **options)
    assert same(longer, eutree.learn(env, episodes=40, **options))


def test_a_longer_run_that_is_stopped_has_no_verdict_of_the_shorter_one(
    env, demonstrations, tmp_path
):
    options = {"demonstrations": demonstrations, "out": tmp_path / "a", "front_steps": 20_000}
    short = eutree.learn(env, episodes=20, **options)
    assert short.against_start is not None
    assert len(short.front) > 1
    steps = iter(range(10_000))
    longer = eutree.learn(env, episodes=60, resume=True, stop=lambda: next(steps) > 200, **options)
    assert 20 < longer.episodes < 60
    assert (longer.against_start, longer.front, longer.picked) == (None, (), None)
    assert longer.policy == longer.learned
    assert not (tmp_path / "a" / "front").exists()
    assert not (tmp_path / "a" / "front.csv").exists()
    assert not (tmp_path / "a" / "learned.json").exists()


@pytest.mark.promise(11)
def test_two_processes_do_not_share_a_run_folder(env, demonstrations, tmp_path):
    def second(run):
        with pytest.raises(RunFolderError, match="in use by process"):
            eutree.learn(env, demonstrations=demonstrations, out=tmp_path / "a", resume=True)
        raise InterruptedRunError

    with pytest.raises(InterruptedRunError):
        eutree.learn(env, demonstrations=demonstrations, out=tmp_path / "a", on_progress=second)


@pytest.mark.parametrize("start", ["demos", "tree+demos"])
def test_learning_offline_needs_no_environment(env, tmp_path, start):
    careless = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.3, seed=1)
    recorded = eutree.record(env, careless, episodes=60, seed=3)
    options = {"demonstrations": recorded, "start": start, "method": "paper", "seed": 1}
    result = eutree.learn(None, out=tmp_path / "a", **options)
    assert (result.episodes, result.steps, result.curve) == (0, 0, ())
    assert 0.5 * recorded.n_transitions < result.history.size < 0.8 * recorded.n_transitions
    assert result.against_fit.n_held_out == 20
    if not result.against_fit.believed:
        assert result.policy == eutree.fit(recorded, episodes=0).policy
    assert same(result, eutree.learn(None, **options))
    assert eutree.TreePolicy.load(tmp_path / "a" / "policy.json") == result.policy
    assert eutree.evaluate(result.policy, env, episodes=100).mean_return > 0


def test_the_tree_of_fit_is_handed_over_as_fit_makes_it():
    """Whoever acted followed the observation before, which ``fit`` sees and the method does not."""
    generator = np.random.default_rng(0)
    episodes = []
    for _ in range(15):
        seen = generator.random((31, 1))
        before = np.concatenate([seen[:1], seen[:-2]])
        actions = (before[:, 0] > 0.5).astype(int)
        episodes.append(Episode(seen, actions, generator.normal(size=30), True, False))
    late = eutree.Demonstrations(tuple(episodes), Schema.anonymous(1, 2))
    result = eutree.learn(None, demonstrations=late, method="paper", return_range=(-99, 99))
    assert result.learned.history == 0
    assert not result.against_fit.believed
    assert "this is the tree of fit" in result.against_fit.describe()
    assert (result.handed_over, result.is_start) == ("start", False)  # it said "learned"
    assert "handed over: start" in repr(result)
    assert result.policy == eutree.fit(late, episodes=0).policy
    assert result.policy.history == 1


@pytest.mark.parametrize("wrong", [(1.0, 0.0), (0.0, np.inf), 3.0])
def test_a_range_of_returns_that_is_none_is_refused(demonstrations, wrong):
    with pytest.raises(InvalidArgumentError, match="return_range must be the lowest and the high"):
        eutree.learn(None, demonstrations=demonstrations, return_range=wrong)


def test_a_range_that_the_recorded_returns_contradict_is_refused(demonstrations):
    message = r"each return, by return_range, must be a number in \[1e\+06, 2e\+06\], got "
    with pytest.raises(InvalidArgumentError, match=message):
        eutree.learn(None, demonstrations=demonstrations, return_range=(1e6, 2e6))


def test_a_planner_does_not_learn_offline(env, demonstrations):
    message = "method 'planning' does not fit this task: it tries what it plans"
    with pytest.raises(InvalidArgumentError, match=message):
        eutree.learn(None, demonstrations=demonstrations, method="planning")


@pytest.mark.parametrize("limit", [{"steps": 100}, {"minutes": 1.0}])
def test_limits_that_are_not_heard_offline_are_refused(demonstrations, limit):
    with pytest.raises(InvalidArgumentError, match="must be None without an environment, got 1"):
        eutree.learn(None, demonstrations=demonstrations, **limit)


def test_a_run_is_not_resumed_with_less_than_it_has_had(env, demonstrations, tmp_path):
    """Its configuration then named a budget that it had passed."""
    options = {"demonstrations": demonstrations, "method": "paper", "out": tmp_path / "a"}
    first = eutree.learn(env, episodes=10, **options)
    config = (tmp_path / "a" / "config.json").read_bytes()
    for less in ({"episodes": 5}, {"steps": first.steps - 1}):
        with pytest.raises(
            RunFolderError, match=r"the run has had \d+ (steps|episodes); ask for mo"
        ):
            eutree.learn(env, resume=True, **less, **options)
    assert (tmp_path / "a" / "config.json").read_bytes() == config
    assert eutree.learn(env, episodes=10, resume=True, **options).policy == first.policy


def test_learning_offline_needs_demonstrations():
    with pytest.raises(InvalidArgumentError, match="'offline learning' needs demonstrations"):
        eutree.learn(None)


@pytest.mark.parametrize("alone", [True, False])
def test_demonstrations_without_rewards_are_not_learned_from(env, demonstrations, alone):
    """A log without a reward column was learned from as if every action had earned 0."""
    episodes = tuple(
        dataclasses.replace(e, rewards=np.zeros(len(e)), has_rewards=False)
        for e in demonstrations.episodes
    )
    log = dataclasses.replace(demonstrations, episodes=episodes)
    message = r"rewards .* of episode 0 are not known; .* eutree fit"
    with pytest.raises(InvalidArgumentError, match=message):
        eutree.learn(None if alone else env, demonstrations=log, **SHORT)
    silent = tuple(dataclasses.replace(e, has_rewards=True) for e in episodes)
    log = dataclasses.replace(demonstrations, episodes=silent)
    if alone:
        with pytest.raises(InvalidArgumentError, match=r"all of theirs are 0; .* eutree fit"):
            eutree.learn(None, demonstrations=log)
    eutree.fit_expert_tree(log)


def test_a_method_of_one_s_own(env, demonstrations):
    mine = dataclasses.replace(PAPER, discount=1.0, gathering_episodes=5)
    result = eutree.learn(env, demonstrations=demonstrations, method=mine, **SHORT)
    assert result.method == mine


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": "tree+demos"}, "'tree.demos' needs demonstrations"),
        ({"start": "trees"}, "unknown start 'trees'. Did you mean 'tree'"),
        ({"method": "papers"}, "unknown method 'papers'. Did you mean 'paper'"),
        ({"episodes": -1}, "episodes must be an integer >= 0, got -1"),
        ({"evaluate_every": 0}, "evaluate_every must be an integer >= 1, got 0"),
        ({"evaluation_episodes": 0}, "evaluation_episodes must be an integer >= 1, got 0"),
        ({"seed": -3}, "seed must be an integer from 0 to .*, got -3"),
        ({"max_transitions": 0}, "max_transitions must be an integer >= 1, got 0"),
        ({"history": -1}, "history must be an integer >= 0, got -1"),
    ],
)
def test_bad_arguments_are_named(env, arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        eutree.learn(env, **arguments)


def test_demonstrations_of_another_environment_are_refused(demonstrations):
    other = gymnasium.make("CartPole-v1")
    with pytest.raises(
        InvalidArgumentError,
        match="demonstrations must have the features and actions of the environment",
    ):
        eutree.learn(other, demonstrations=demonstrations)


class Broken(gymnasium.Wrapper):
    """Breaks at its n-th step."""

    def __init__(self, env, lives):
        super().__init__(env)
        self.lives = lives

    def step(self, action):
        self.lives -= 1
        if self.lives < 0:
            raise RuntimeError("the cable is loose")
        return self.env.step(action)


def test_a_run_that_fails_before_its_first_step_leaves_nothing_in_the_way(tmp_path):
    out = tmp_path / "run"
    wanted = {"method": "planning", "episodes": 2, "evaluation_episodes": 2, "out": out}
    broken = Broken(gymnasium.make("MountainCar-v0"), 0)
    with pytest.raises(EnvironmentFault, match="the cable is loose"):
        eutree.learn(broken, seed=1, **wanted)
    assert {path.name for path in out.iterdir()} <= {".lock"}
    again = eutree.learn(gymnasium.make("MountainCar-v0"), seed=2, **wanted)  # not the same run
    assert again.policy == eutree.TreePolicy.load(out / "policy.json")
