"""The method ``distilled-dqn``: its stages, its budget, going on from a state, what it refuses."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from eutree.contests.rules import Lead
from eutree.data import Demonstrations
from eutree.envs.experts import follow_the_fall
from eutree.errors import FormatError, InvalidArgumentError
from eutree.interaction import GuardedEnv, episode_seed
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.distilled_dqn.races import RacedTree
from eutree.learners.distilled_dqn.state import Stage
from eutree.learners.learner import Problem, Start, Step
from eutree.neural import DoubleDQNSettings
from eutree.recording import record
from eutree.world_model.action_trees import packed
from eutree.world_model.ensemble import EnsembleSettings
from eutree.world_model.ensemble_rollouts import EnsembleRollouts
from tests.learners.battery import checked_state

BUDGET = 6000
METHOD = DistilledDQN(
    max_leaves=4,
    learning_share=0.8,
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
    assert len(loop.learner.races.trees) >= 4


def test_the_teacher_goes_on_learning_from_trees(whole, shown, env):
    loop, states = whole
    known = [int(states[stage][0]["teacher_updates"][0]) for stage in (Stage.DAGGER, Stage.RACE)]
    assert known[0] < known[1]
    learned = METHOD.teacher.updates_per_step * METHOD.learning_share * BUDGET
    assert loop.learner.teacher.updates == pytest.approx(learned, rel=0.15)
    few = replace(METHOD, learning_share=0.0)
    loop = Loop(few.start(problem_of(shown), Start(None, shown.kept)), env, 0)
    while loop.learner.stage is Stage.TEACHER:
        loop.advance()
    updates = loop.learner.teacher.updates
    loop.advance()
    assert loop.learner.teacher.updates == updates


def test_a_teacher_without_steps_of_its_own_learns_from_demonstrations(shown, env):
    """It taught with its first weights, which are random."""
    loop = Loop(replace(METHOD, teacher_share=0.0, learning_share=0.0).start(
        problem_of(shown), Start(None, shown.kept)), env, 0)  # fmt: skip
    while loop.learner.stage is Stage.TEACHER:
        loop.advance()
    assert loop.learner.teacher.updates >= METHOD.demonstration_updates


def test_labels_are_those_of_the_present_teacher(whole, shown):
    state = copied(whole[1][Stage.RACE, "within"][0])
    learner = METHOD.restore(problem_of(shown), Start(None, shown.kept), state)
    observations, first = learner.history.observations, learner.dagger.labelled_from
    students = learner._students
    students.fit(observations, 4)
    assert (students._labels == learner.teacher.predict(observations[first:])[0]).all()
    observation = observations[0]
    learner.start_episode(observation, np.random.default_rng(0))
    learner.observe(Step(0, 1.0, observation, True, False))
    learner.end_episode()
    learner.update(np.random.default_rng(1))
    assert students._labels.size == 0


def test_the_policy_changes_only_by_a_race(whole):
    loop, states = whole
    for key in (Stage.TEACHER, Stage.DAGGER, Stage.RACE):
        assert states[key][0]["numbers"][4] == 0  # the incumbent is the start
    races = loop.learner.races
    won = races.trees[races.incumbent]
    assert won.origin == "start" or won.mean_return > races.trees[0].mean_return


@pytest.mark.parametrize("stage", [Stage.TEACHER, Stage.DAGGER, Stage.RACE])
def test_a_learner_goes_on_from_any_stage_to_the_same_bytes(stage, whole, shown, env):
    loop, states = whole
    state, steps, gathered = states[stage, "within"]
    checked_state("checkpoint.npz", state, METHOD, problem_of(shown), Start(None, shown.kept))
    learner = METHOD.restore(problem_of(shown), Start(None, shown.kept), state)
    other = Loop(learner, env, 0)
    other.steps, other.gathered = steps, gathered
    while not other.finished:
        other.advance()
    mine, theirs = loop.learner.state(), learner.state()
    assert set(mine) == set(theirs)
    assert [name for name in mine if mine[name].tobytes() != theirs[name].tobytes()] == []


def test_a_model_keeps_its_circles_unless_it_is_of_before(whole, shown):
    problem, start = problem_of(shown), Start(None, shown.kept)
    state = dict(whole[1][Stage.RACE, "within"][0])
    assert state.pop("model_circles").shape == (0, 2)
    for circles in (np.array([[0, 1], [3, 2]]), None):
        known = state if circles is None else state | {"model_circles": circles}
        checked_state("checkpoint.npz", known, METHOD, problem, start)
        learner = METHOD.restore(problem, start, known)
        again = learner.state()["model_circles"]
        assert again.tolist() == ([] if circles is None else circles.tolist())
    wrong = state | {"model_circles": np.array([[0, 4]])}
    with pytest.raises(FormatError, match=r"model_circles.*0\.\.3"):
        checked_state("checkpoint.npz", wrong, METHOD, problem, start)


def test_a_state_has_the_sums_and_what_is_of_their_features(shown, env):
    method = replace(METHOD, sums=2, dagger_share=0.3)
    problem, start = problem_of(shown), Start(None, shown.kept, teacher=Scripted())
    loop = Loop(method.start(problem, start), env, 0)
    while loop.learner.stage is not Stage.RACE or loop.learner.races.is_run:
        loop.advance()
    state = copied(loop.learner.state())
    n = len(state["sums"])
    assert n > 0
    assert state["model_starts"].shape[1] == state["history_observations"].shape[1] + n == 4 + n
    checked_state("checkpoint.npz", state, method, problem, start)
    again = method.restore(problem, start, state)
    assert again.decisions().derived == loop.learner.decisions().derived
    policy = again.decisions().policy(problem)
    rows = loop.learner.history.observations[-50:]
    acted = [again._students.act(again.races.policy, row) for row in rows]
    assert policy.predict(rows)[0].tolist() == acted
    for name, change in (
        ("sums", lambda a: np.vstack([a, a, a])), ("sums", lambda a: a[:, :3]),
        ("sums", lambda a: a[:0]), ("contender_feature", lambda a: np.where(a >= 0, 4 + n, a)),
        ("model_low", lambda a: a[:4]),
    ):  # fmt: skip
        with pytest.raises(FormatError, match=r"checkpoint\.npz"):
            checked_state("checkpoint.npz", state | {name: change(state[name])}, method, problem,
                          start)  # fmt: skip


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
    assert small.races.trees[0].origin == "start"
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
        ("teacher_known", lambda a: a + 10**6),
    ],
)
def test_a_state_that_cannot_be_trusted_is_refused(name, change, whole, shown):
    state = copied(whole[1][Stage.RACE, "within"][0])
    checked_state("checkpoint.npz", state, METHOD, problem_of(shown), Start(None, shown.kept))
    state[name] = change(state[name])
    with pytest.raises(FormatError, match=r"checkpoint\.npz"):
        checked_state("checkpoint.npz", state, METHOD, problem_of(shown), Start(None, shown.kept))


def test_a_policy_that_ran_often_outweighs_a_few_lucky_episodes():
    generator = np.random.default_rng(0)
    luck = generator.standard_normal(200)
    luck -= luck.mean()
    known = RacedTree(packed(0), "start", returns=(100.0 + 50.0 * luck).tolist())
    lucky = RacedTree(packed(1), "cart", returns=[40.0, 190.0, 100.0])
    assert lucky.mean_return > known.mean_return
    assert lucky.sure_worth(0.0) < known.sure_worth(0.0)
    assert RacedTree(packed(0), "cart", returns=[1.0]).sure_worth(0.0) == -np.inf


def test_of_two_that_earn_as_much_the_smaller_is_worth_more():
    leaf, stump = packed(0), packed((0, 0.0, 0, 1))
    small, large = (RacedTree(tree, "cart", returns=[4.0, 6.0] * 9) for tree in (leaf, stump))
    assert small.worth(0.1) - large.worth(0.1) == pytest.approx(0.1)
    assert small.sure_worth(0.1) > large.sure_worth(0.1)
    assert small.sure_worth(0.0) == large.sure_worth(0.0)


def test_choices_are_checked():
    with pytest.raises(InvalidArgumentError, match="max_leaves must be an integer >= 2, got 1"):
        DistilledDQN(max_leaves=1)
    with pytest.raises(InvalidArgumentError, match=r"dagger_share must be a number in \[0, 1\]"):
        DistilledDQN(dagger_share=1.5)


class Scripted:
    """Follows the fall, and values it by how far the pole has fallen."""

    reads_features = True

    def action_values(self, observations):
        fall = observations[:, 2] + 0.5 * observations[:, 3]
        return np.stack([-fall, fall], axis=1)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return self.action_values(np.atleast_2d(observation)).argmax(axis=1), state


def test_a_teacher_of_ones_own_is_asked_and_never_trained(shown, env):
    loop = Loop(
        METHOD.start(problem_of(shown), Start(None, shown.kept, teacher=Scripted())), env, 0
    )
    while not loop.finished:
        if loop.learner.stage is Stage.RACE:
            break
        loop.advance()
    assert loop.learner.update(loop.generator(9)).figures.get("updates", 0) == 0
    assert isinstance(loop.learner.teacher, Scripted)
    history, first = loop.learner.history, loop.learner.dagger.labelled_from
    said = Scripted().action_values(history.observations[first:]).argmax(axis=1)
    assert (loop.learner._students._labels == said).all()
    state = loop.learner.state()
    assert not [name for name in state if name.startswith("teacher_")]
    again = METHOD.restore(
        problem_of(shown), Start(None, shown.kept, teacher=Scripted()), copied(state)
    )
    mine, theirs = again.state(), state
    assert [name for name in mine if mine[name].tobytes() != theirs[name].tobytes()] == []


def raced_tree(place, n=40):
    luck = np.random.default_rng(place).standard_normal(n)
    return RacedTree(packed(place % 2), "pruned", float(place), (place + 3.0 * luck).tolist())


@pytest.mark.parametrize(("ordered", "adopted"), [(True, 1), (False, 0)])
def test_a_model_whose_order_may_be_chance_needs_a_clear_win(ordered, adopted, whole, shown):
    """A challenger leads by 1.3 standard errors: enough where the model is known to order trees."""
    learner = METHOD.start(problem_of(shown), Start(None, shown.kept))
    learner.challengers.ensemble = whole[0].learner.challengers.ensemble
    races = learner.races
    pairs = np.random.default_rng(3).standard_normal(72)
    pairs = (pairs - pairs.mean()) / pairs.std(ddof=1) * np.sqrt(72)
    lead = Lead.of(pairs + 1.3)
    assert lead.mean / lead.error == pytest.approx(1.3)
    others = [raced_tree(place) for place in range(2, 12)]
    if not ordered:
        for one, imagined in zip(others, (3, 9, 5, 2, 11, 6, 4, 10, 8, 7), strict=True):
            one.imagined = float(imagined)
    races.trees = [
        RacedTree(packed(0), "start", 0.0, [0.0, -8.0, 8.0]),
        RacedTree(packed(1), "pruned", 1.0, (1.3 + 0.01 * pairs).tolist()),
        *others,
    ]
    races.entrants = [0, 1]
    races.take_up((72,), np.array([np.zeros(72), pairs + 1.3]))
    assert learner.model_trust().better_than_chance is ordered
    facts = races.end(learner.model_trust())
    assert facts["policy"] == races.incumbent == adopted
    assert facts["trees_compared"] == 11


def test_a_model_is_compared_with_what_trees_really_earned(whole, shown):
    """All scores are of one model and the same imagined episodes; all returns are of races."""
    learner = METHOD.restore(
        problem_of(shown), Start(None, shown.kept), copied(whole[0].learner.state())
    )
    ensemble, trees = learner.challengers.ensemble, learner.races.trees
    learner.challengers.imagine(trees, learner.races.policy, np.random.default_rng(4))
    for one in trees:
        alone = EnsembleRollouts(ensemble, 50, np.random.default_rng(4))
        alone.run(one.tree)
        assert one.imagined == pytest.approx(alone.score(alone.returns))
    for place, one in enumerate(trees):
        one.returns = [float(place)] * (place + 2)  # the first two ran too seldom
    trust = learner.model_trust()
    met = trees[2:]
    assert trust.real.tolist() == [one.mean_return for one in met]
    assert trust.imagined.tolist() == [one.imagined for one in met]
    assert trust.episodes.tolist() == list(range(4, len(trees) + 2))


@pytest.mark.parametrize("affordable", [3, 14, 100])
def test_no_more_challengers_race_than_can_be_run_until_the_first_look(affordable, whole, shown):
    """With 14 episodes left, six trees had two or three each, and one that is poor won by luck."""
    _, states = whole
    learner = METHOD.restore(
        problem_of(shown), Start(None, shown.kept), copied(states[Stage.RACE][0])
    )
    mean_length = learner._experience.mean_length
    learner.steps = BUDGET - int(np.ceil(affordable * mean_length))
    before = len(learner.races.trees)
    learner._propose(np.random.default_rng(5))
    races, proposed = learner.races, range(before, len(learner.races.trees))
    entrants = set(races.entrants[1:])
    assert len(entrants) == min(max(affordable // 4 - 1, 1), len(proposed))
    left_out = set(proposed) - entrants
    assert bool(left_out) == (affordable < 100)
    if left_out:
        best_left_out = max(races.trees[one].imagined for one in left_out)
        assert min(races.trees[one].imagined for one in entrants) >= best_left_out


def test_it_needs_demonstrations(shown):
    refusal = METHOD.needs.refusal(problem_of(shown), Start())
    assert refusal == "it starts from demos or tree+demos, got nothing"
