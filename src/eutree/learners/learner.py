"""The protocol of learners: where one starts, how it learns, what the loop of a run asks of it.

Two things are told apart. A *start* is where learning begins: from nothing, the expert tree, the
demonstrations, or both; the paper's C. U-Tree, EU-Tree - DT and EU-Tree are three starts. A
*method* is how it goes on: a frozen dataclass of its own choices that makes a learner for a problem
and a start. A *learner* takes steps and returns actions; it never sees an environment, and between
two episodes its whole memory is ``state()``.

The loop of a run, for every method:

    learner.start_episode(observation, generator)
    until the episode ends:  action = learner.act();  ...;  learner.observe(Step(action, ...))
    learner.end_episode()                  # or discard_episode(): as if it had not begun
    every ``gathering_episodes`` episodes: learner.update(generator)
    whenever a policy is wanted:           learner.decisions().policy(problem)

Each ability that only some learners have is a protocol of its own, which its user checks for by
``isinstance``: ``ChoosesStarts``, ``HasStages``, ``Imagines``, ``TriesTrees`` and others below.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.data import Episode
from eutree.errors import InvalidArgumentError, noted
from eutree.features import FeatureMap
from eutree.learners.declared import Arrays as Arrays
from eutree.learners.declared import Declared, Part, give_back
from eutree.learners.history import History
from eutree.policies import LeafStatistics, Policy, TreePolicy
from eutree.policy_search.model_trust import ModelTrust
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from eutree.world_model import PairedRollouts

Figure: TypeAlias = float | int | str | list[float] | list[int] | None
Figures: TypeAlias = dict[str, Figure]
TrueModel: TypeAlias = Callable[[Floats, Integers], tuple[Floats, Floats, Booleans]]
StartName: TypeAlias = Literal["nothing", "tree", "tree+demos", "demos", "random-tree"]
GIVEN = ("tree", "tree+demos")  # whose tree is somebody's


class ValuingPolicy(Policy, Protocol):
    """A policy that values each action."""

    def action_values(self, observations: Floats) -> Floats:
        """Return the value of each action at observations [N, d], shape [N, A]."""


class Step(NamedTuple):
    """One step: the action taken at the present observation, its reward and where it led.

    A truncated episode is no terminal one: its value goes on where it was cut short.

    Attributes:
        action: Index of the action taken.
        reward: Its reward.
        observation: The next observation, shape [d].
        terminated: Whether the task ended the episode; value 0 follows.
        truncated: Whether a limit outside the task cut it short.
        info: The environment's further words.
        allowed: Which actions were allowed where it was taken, shape [A]; None for all.
    """

    action: int
    reward: float
    observation: Floats  # [d]
    terminated: bool
    truncated: bool
    info: Mapping[str, Any] = MappingProxyType({})
    allowed: Booleans | None = None  # [A]


@dataclass(frozen=True)
class Problem:
    """All that a learner may know before the first step.

    Attributes:
        schema: Names, units and bounds of the features, previous observations included; names of
            the actions.
        environment: How to make the environment again, where that is known.
        history: Number of previous observations among the features.
        past_actions: Number of previous actions among the features.
        max_episode_steps: Steps after which the environment truncates; None if it never does.
        steps: The run's budget of environment steps; None where it is counted in episodes.
        model: The environment's own model, where it offers one: from states [N, d] and actions [N]
            to next states, rewards [N] and endings [N], without noise.
    """

    schema: Schema
    environment: EnvironmentSpec | None = None
    history: int = 0
    past_actions: int = 0
    max_episode_steps: int | None = None
    steps: int | None = None
    model: TrueModel | None = None

    @property
    def n_features(self) -> int:
        """Number of features d."""
        return self.schema.n_features

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        return self.schema.n_actions

    @property
    def low(self) -> Floats:
        """Smallest possible value of each feature, -inf where unbounded, shape [d]."""
        return np.array([feature.low for feature in self.schema.features])

    @property
    def high(self) -> Floats:
        """Largest possible value of each feature, inf where unbounded, shape [d]."""
        return np.array([feature.high for feature in self.schema.features])

    def declare(self, *parts: Part, **sizes: int) -> Declared:
        """Return the declaration of a state in the features and actions of this problem."""
        return Declared(self.n_features, self.n_actions, parts, sizes)


@dataclass(frozen=True, eq=False)
class Start:
    """Where a learner begins.

    Attributes:
        expert: The tree it starts from: fitted to demonstrations, written by hand, or random.
        episodes: Demonstrations whose transitions it knows.
        random: Whether ``expert`` is a random tree, whose labels mean nothing.
        by_chance: Whether the episodes are those of random actions: nobody has shown anything.
        teacher: Who names actions at observations that are met later; None if nobody does.
    """

    expert: TreePolicy | None = None
    episodes: tuple[Episode, ...] = ()
    random: bool = False
    by_chance: bool = False
    teacher: ValuingPolicy | None = None

    @property
    def name(self) -> StartName:
        """Which start it is."""
        if self.random or self.by_chance:
            return "random-tree" if self.random else "nothing"
        if self.expert is None:
            return "demos" if self.episodes else "nothing"
        return "tree+demos" if self.episodes else "tree"

    def first_leaves(self, problem: Problem) -> tuple[DecisionTree, Integers, tuple[int, ...]]:
        """Return the tree to begin from, the expert's or a single leaf.

        With it come the action of each leaf while nothing is known of it, shape [L], and the leaves
        that nothing may change, in order.
        """
        if self.expert is None:
            single = DecisionTree.single_leaf(problem.n_features)
            return single, np.zeros(1, dtype=np.int64), ()
        return self.expert.tree, self.expert.actions, self.expert.locked


class LeafSplit(NamedTuple):
    """A cut of a leaf: ``x[feature] <= threshold`` keeps ``leaf``, the rest gets ``new_leaf``."""

    leaf: int
    new_leaf: int
    feature: int
    threshold: float


@dataclass(frozen=True)
class Update:
    """The outcome of an update, for the log of the run.

    Attributes:
        splits: Leaves that were split, in order.
        figures: Numbers of the method's own, by name; one that is not finite is noted as none.
    """

    splits: tuple[LeafSplit, ...] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Decisions:
    """The policy of a learner if it learned no more, as a tree.

    Attributes:
        tree: The tree.
        actions: Action of each leaf.
        statistics: Visits and values of the rule that decides; None if it has none by leaf.
        locked: Leaves that nothing may change, in order.
        fidelity: Share of the learner's own decisions on its observations that the tree makes
            too; 1.0 unless the tree is fitted to a policy that is no tree.
        features: How the problem's observations become the features of the tree, if the learner
            remembers more of the past than the problem does; None if they are its observations.
        derived: Declarations of derived features that the tree has behind the problem's.
    """

    tree: DecisionTree
    actions: Integers  # [L]
    statistics: LeafStatistics | None = None
    locked: tuple[int, ...] = ()
    fidelity: float = 1.0
    features: FeatureMap | None = None
    derived: tuple[str, ...] = ()

    def policy(self, problem: Problem) -> TreePolicy:
        """Return the decisions as a policy with the names of the problem."""
        schema, history, past_actions = problem.schema, problem.history, problem.past_actions
        if self.features is not None and not self.features.is_identity:
            if history or past_actions:
                raise InvalidArgumentError(
                    "history must be 0 with a method that remembers by itself, got "
                    f"{max(history, past_actions)}"
                )
            history, past_actions = self.features.observations, self.features.actions
            schema = schema.with_history(history, past_actions)
        return TreePolicy(
            tree=self.tree,
            actions=self.actions,
            schema=schema.derive(self.derived),
            environment=problem.environment,
            history=history,
            past_actions=past_actions,
            leaves=self.statistics,
            locked=self.locked,
        )


def reached(episodes: Sequence[Episode]) -> Booleans:
    """Return which episodes reached the goal, shape [E].

    The environment says so by ``is_success``. Where it says nothing, an end is a good one if its
    reward is no less than the mean return from a step that goes on: an end that saves further cost
    is a goal, one that cuts earning short is not.
    """
    to_go = [np.cumsum(episode.rewards[::-1])[::-1] for episode in episodes]
    ongoing = [x[:-1] if e.terminated else x for x, e in zip(to_go, episodes, strict=True)]
    flat = np.concatenate([*ongoing, np.empty(0)])
    level = float(flat.mean()) if flat.size else 0.0
    good = [bool(e.terminated and len(e) and e.rewards[-1] >= level) for e in episodes]
    said = [e.is_success for e in episodes]
    known = [end if own is None else bool(own) for own, end in zip(said, good, strict=True)]
    return np.array(known, dtype=np.bool_)


@dataclass(frozen=True, kw_only=True)
class Needs:
    """The demands of a method on a problem and a start.

    Attributes:
        goal: The demonstrations must hold an episode that reached the task's goal.
        gathering: It must act: recorded episodes alone are not enough.
        max_features: Most features it can cope with; None for any number.
        starts: The starts that mean something to it.
        asks_teacher: It can ask a teacher; others refuse one.
        chance_will_do: Where there are no demonstrations, episodes of random actions will do.
        keeps_locks: Locked leaves of the expert tree stay as they are.
    """

    goal: bool = False
    gathering: bool = False
    max_features: int | None = None
    starts: tuple[StartName, ...] = ("nothing", "tree", "tree+demos", "demos", "random-tree")
    asks_teacher: bool = False
    chance_will_do: bool = False
    keeps_locks: bool = False

    def refusal(self, problem: Problem, start: Start, *, offline: bool = False) -> str:
        """Return why the method does not fit, or ""."""
        if offline and self.gathering:
            return "it tries what it plans, so it needs an environment to act in"
        if start.name not in self.starts and not (start.by_chance and self.chance_will_do):
            return f"it starts from {' or '.join(self.starts)}, got {start.name}"
        if start.teacher is not None and not self.asks_teacher:
            return "it asks no teacher; distilled-dqn does"
        if start.expert is not None and start.expert.locked and not self.keeps_locks:
            return "it does not keep the locked leaves of the expert tree; planning does"
        if self.goal and not reached(start.episodes).any():
            return "it needs a goal: a demonstration that reached it (is_success, or a good end)"
        if self.max_features is not None and problem.n_features > self.max_features:
            return f"it copes with {self.max_features} features, got {problem.n_features}"
        return ""


class Learner(Protocol):
    """Takes steps and returns actions."""

    @property
    def history(self) -> History:
        """The store of all transitions."""

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; all its chance is ``generator``."""

    def act(self) -> int:
        """Return the action for the present observation; see ``ActsAmongAllowed``."""

    def observe(self, step: Step) -> None:
        """Take a step; learn from it at once, or only keep it."""

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""

    def update(self, generator: np.random.Generator) -> Update:
        """Learn from the history: an expansion phase, a planning, a clustering."""

    def decisions(self) -> Decisions:
        """Return the present policy as a tree."""

    def state(self) -> Arrays:
        """Return all that is known between two episodes; ``Method.restore`` takes it back."""


class ActsAmongAllowed(Protocol):
    """A learner that knows of masks. Of others a masked action is replaced by a random one."""

    def act(self, allowed: Booleans | None = None) -> int:
        """Return the action for the present observation, among those that are allowed, [A]."""


class Method(Protocol):
    """How to learn: a frozen, keyword-only dataclass of this method's own choices and no others.

    It is written to ``config.json`` and read back by msgspec.

    Attributes:
        name: Its name in the registry and on the command line.
        needs: Its demands on a problem and a start, checked before a run.
        gathering_episodes: Episodes between two updates.
    """

    name: ClassVar[str]
    needs: ClassVar[Needs]

    @property
    def gathering_episodes(self) -> int:
        """Episodes between two updates."""

    def start(self, problem: Problem, start: Start) -> Learner:
        """Return a learner at its start."""

    def restore(self, problem: Problem, start: Start, state: Arrays) -> Learner:
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``: names, elements, axes and ranges.

        A checkpoint is compared with it before ``restore`` is called. Compiled loops trust their
        indices, so the range of each index is the size of the array that it points into.
        """


class MethodOfParts:
    """A method whose learners are saved and restored by the parts that it declares.

    Their ``state()`` is ``arrays_of(self, parts)``; one at a start without demonstrations takes it.
    """

    start: Callable[[Problem, Start], Any]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of a learner's state."""
        raise NotImplementedError

    def restore(self, problem: Problem, start: Start, state: Arrays) -> Any:
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return give_back(self.start(problem, replace(start, episodes=())), self.parts, state)

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``."""
        return problem.declare(*self.parts)


@runtime_checkable
class ChoosesStarts(Protocol):
    """A learner that compares trees in its own episodes, on starts that they have in common."""

    def next_start(self) -> int | None:
        """Return the number of the start of the next episode; None if any will do.

        Episodes of one number begin alike: the environment is reset with the same seed.
        """


@runtime_checkable
class HasStages(Protocol):
    """A learner that does one thing after another."""

    @property
    def stage_name(self) -> str:
        """The name of the present stage, in one or two words."""


@runtime_checkable
class HasTeacher(Protocol):
    """A learner whose trees copy a teacher."""

    @property
    def teacher(self) -> ValuingPolicy:
        """Who teaches."""

    @property
    def teacher_acts(self) -> bool:
        """Whether the present episode is the teacher's."""


@runtime_checkable
class KnowsItsModel(Protocol):
    """A learner that compares the imagined returns of trees with their real ones."""

    def model_trust(self) -> ModelTrust | None:
        """Return how its world model orders trees that were run; None without one."""


@runtime_checkable
class Imagines(Protocol):
    """A learner with a world model in which any tree can act."""

    def imagined(self, n_episodes: int, generator: np.random.Generator) -> PairedRollouts | None:
        """Return where trees can be compared, in so many episodes of each; None at first."""


@runtime_checkable
class TriesTrees(Protocol):
    """A learner whose trees act in episodes of their own before one becomes the policy."""

    def on_trial(self) -> Decisions | None:
        """Return the tree that waits for its evaluation to end; None if there is none."""


@runtime_checkable
class HasPolicy(Protocol):
    """A learner whose own policy is no tree; it is evaluated beside the tree of its decisions."""

    def own_policy(self) -> Policy:
        """Return the present policy, frozen."""


def check_fits(method: Method, problem: Problem, start: Start, *, offline: bool = False) -> None:
    """Raise InvalidArgumentError unless a method fits a problem and a start."""
    reason = method.needs.refusal(problem, start, offline=offline)
    if reason:
        raise InvalidArgumentError(f"method {method.name!r} does not fit this task: {reason}")


def check_has_all(one: object, protocol: type, kind: type, besides: Iterable[str] = ()) -> None:
    """Raise InvalidArgumentError unless a method or its learner has all that a protocol names."""
    wanted = [n for n in (*protocol.__annotations__, *vars(protocol)) if not n.startswith("_")]
    lacking = [name for name in wanted if not hasattr(one, name) and name not in besides]
    if lacking:
        whose = "" if one is kind else "the learner of "
        raise InvalidArgumentError(
            f"{whose}{_named(kind)} lacks {', '.join(lacking)}; see docs/your-own-method.md"
        )


def own_code(method: object) -> AbstractContextManager[None]:
    """Name a method on what its own code raises, where it is another author's."""
    return noted(type(method), _named(type(method)))


def _named(kind: type) -> str:
    """Return the name of a method, and where its class is."""
    name = getattr(kind, "name", kind.__name__)
    return f"method {name!r} ({kind.__module__}:{kind.__qualname__})"
