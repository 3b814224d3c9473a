"""The method ``distilled-dqn``: its stages, its budget, going on from a state, what it refuses."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.envs.experts import follow_the_fall
from eutree.errors import FormatError, InvalidArgumentError
from eutree.interaction import GuardedEnv, episode_seed, record
from eutree.learners.contenders import Contender
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.distilled_dqn_learner import Stage
from eutree.learners.learner import Problem, Start, Step
from eutree.neural import DoubleDQNSettings
from eutree.world_model.action_trees import single_action
from eutree.world_model.ensemble import EnsembleSettings

BUDGET = 6000
METHOD = DistilledDQN(
    max_leaves=4,
    demonstration_updates=50,
    teacher=DoubleDQNSettings(hidden=16, batch=16),
    world_model=EnsembleSettings(members=2, hidden=16, batch=32, updates=100, more_updates=50),
)


class Loop:
    """The loop of a run: an episode, from a start of the learner's choice, and an update."""

    def __init__(self, learner, env, seed):
        self.learner, self.seed = learner, seed
        self.steps, self.gathered = 0, 0
        self._env = GuardedEnv(env)

    @property
    def finished(self):
        return self.steps + 500 > BUDGET

    def advance(self):
        number = self.learner.next_start()
        seed = episode_seed(self.seed, self.gathered, 2)
        if number is not None:
            seed = episode_seed(self.seed, number, 33)
        observation = self._env.reset(seed)
        self.learner.start_episode(observation, self.generator(3))
        ended = False
        while not ended:
            action = self.learner.act()
            observation, reward, terminated, truncated, _ = self._env.step(action)
            ended = terminated or truncated
            self.learner.observe(Step(action, reward, observation, terminated, truncated))
            self.steps += 1
        self.learner.end_episode()
        self.learner.update(self.generator(4))
        self.gathered += 1

    def generator(self, stream):
        return np.random.default_rng((self.seed, stream, self.gathered))


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("CartPole-v1")


@pytest.fixture(scope="module")
def shown(env):
    return record(env, follow_the_fall, episodes=5, seed=0)


def problem_of(shown: Demonstrations) -> Problem:
    return Problem(shown.schema, shown.environment, max_episode_steps=500, steps=BUDGET)


def loop_of(shown, env, seed):
    return Loop(METHOD.start(problem_of(shown), Start(None, shown.kept)), env, seed)


@pytest.fixture(scope="module")
def whole(shown, env):
    """A whole run, and the state before the first episode of each stage and in each stage."""
    loop, states = loop_of(shown, env, 0), {}
    n = 0
    while not loop.finished:
        stage = loop.learner.stage
        if stage not in states or n % 7 == 6:
            now = copied(loop.learner.state()), loop.steps, loop.gathered
            states.setdefault(stage, now)
            states[stage, "within"] = now
        loop.advance()
        n += 1
    return loop, states


def copied(state):
    return {name: np.array(array) for name, array in state.items()}


def test_all_stages_are_passed_and_the_budget_is_kept(whole):
    loop, states = whole
    assert {Stage.TEACHER, Stage.DAGGER, Stage.RACE} <= set(states)
    assert loop.learner.steps == loop.steps
    assert BUDGET - 500 < loop.steps <= BUDGET
    policy = loop.learner.decisions()
    assert policy.tree.n_leaves <= METHOD.max_leaves
    assert len(loop.learner.contenders) >= 4


def test_the_policy_changes_only_by_a_race(whole):
    loop, states = whole
    for key in (Stage.TEACHER, Stage.DAGGER, Stage.RACE):
        assert states[key][0]["numbers"][4] == 0  # the incumbent is the start
    won = loop.learner.contenders[loop.learner.incumbent]
    assert won.origin == "start" or won.mean_return > loop.learner.contenders[0].mean_return


@pytest.mark.parametrize("stage", [Stage.TEACHER, Stage.DAGGER, Stage.RACE])
def test_a_learner_goes_on_from_any_stage_to_the_same_bytes(stage, whole, shown, env):
    loop, states = whole
    state, steps, gathered = states[stage, "within"]
    METHOD.check_state("checkpoint.npz", state, problem_of(shown))
    learner = METHOD.restore(problem_of(shown), Start(None, shown.kept), state)
    other = Loop(learner, env, 0)
    other.steps, other.gathered = steps, gathered
    while not other.finished:
        other.advance()
    mine, theirs = loop.learner.state(), learner.state()
    assert set(mine) == set(theirs)
    assert [name for name in mine if mine[name].tobytes() != theirs[name].tobytes()] == []


def test_another_seed_gives_another_run(whole, shown, env):
    _, states = whole
    other = loop_of(shown, env, 1)
    for _ in range(5):
        other.advance()
    assert other.learner.steps != 0
    own = states[Stage.TEACHER, "within"][0]["teacher_online"]
    assert other.learner.state()["teacher_online"].tobytes() != own.tobytes()


def test_a_discarded_episode_leaves_nothing_behind(shown, env):
    loop = loop_of(shown, env, 0)
    loop.advance()
    before = copied(loop.learner.state())
    loop.learner.start_episode(np.zeros(4), np.random.default_rng(5))
    loop.learner.observe(Step(loop.learner.act(), 1.0, np.ones(4), False, False))
    loop.learner.discard_episode()
    after = loop.learner.state()
    assert [name for name in before if before[name].tobytes() != after[name].tobytes()] == []


def test_an_expert_tree_that_is_too_large_is_replaced(shown):
    small = METHOD.start(problem_of(shown), Start(None, shown.kept))
    assert small.contenders[0].origin == "start"
    assert small.decisions().tree.n_leaves <= 4
    cramped = replace(METHOD, max_leaves=2).start(problem_of(shown), Start(None, shown.kept))
    assert cramped.decisions().tree.n_leaves == 2


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("history_actions", lambda a: a + 7),
        ("history_observations", lambda a: a[:, :2]),
        ("contender_action", lambda a: a + 5),
        ("contender_feature", lambda a: np.where(a >= 0, 99, a)),
        ("contender_left", lambda a: a + 1000),
        ("race_entrants", lambda a: a + 50),
        ("race_returns", lambda a: a[:, :3]),
        ("race_run", lambda a: a + 10**6),
        ("numbers", lambda a: a[:3]),
    ],
)
def test_a_state_that_cannot_be_trusted_is_refused(name, change, whole, shown):
    state = copied(whole[1][Stage.RACE, "within"][0])
    METHOD.check_state("checkpoint.npz", state, problem_of(shown))
    state[name] = change(state[name])
    with pytest.raises(FormatError, match=r"checkpoint\.npz"):
        METHOD.check_state("checkpoint.npz", state, problem_of(shown))


def test_a_policy_that_ran_often_outweighs_a_few_lucky_episodes():
    generator = np.random.default_rng(0)
    luck = generator.standard_normal(200)
    luck -= luck.mean()
    known = Contender(single_action(0), "start", returns=(100.0 + 50.0 * luck).tolist())
    lucky = Contender(single_action(1), "cart", returns=[40.0, 190.0, 100.0])
    assert lucky.mean_return > known.mean_return
    assert lucky.sure_return < known.sure_return
    assert Contender(single_action(0), "cart", returns=[1.0]).sure_return == -np.inf


def test_choices_are_checked():
    with pytest.raises(InvalidArgumentError, match="max_leaves must be an integer >= 2, got 1"):
        DistilledDQN(max_leaves=1)
    with pytest.raises(InvalidArgumentError, match=r"dagger_share must be a number in \[0, 1\]"):
        DistilledDQN(dagger_share=1.5)


def test_it_needs_demonstrations(shown):
    refusal = METHOD.needs.refusal(problem_of(shown), Start())
    assert refusal == "it starts from demos or tree+demos, got nothing"
