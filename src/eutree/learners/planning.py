"""Model-based planning of a tree: the default method.

The learner acts by whole trees. The incumbent is the policy; challengers are planned in a world
model that is fitted to all stored transitions, and act in episodes of their own before one of them
becomes the incumbent (:mod:`eutree.policy_search.planner`). There is no table of values over
leaves: returns decide.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.c45 import C45Settings, grow
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.features import Derivation
from eutree.learners.declared import (
    MOST,
    TREE_AND_HISTORY,
    Arrays,
    Part,
    Stored,
    action_tree_part,
    arrays_of,
    bounds_part,
)
from eutree.learners.episode_buffer import EpisodeBuffer, random_action, store, transitions_of
from eutree.learners.forgetting import RecentEpisodes
from eutree.learners.history import History
from eutree.learners.learner import Decisions, MethodOfParts, Needs, Problem, Start, Step, Update
from eutree.policies import LeafStatistics, TreePolicy
from eutree.policies.leaf_statistics import returns_by_action
from eutree.policy_search.planner import Planned, Planner
from eutree.policy_search.variation import Variation
from eutree.schema import Schema
from eutree.trees.edit import graft
from eutree.validation import check_amounts, check_number
from eutree.world_model import ActionTree, PairedRollouts, Transitions, countable
from eutree.world_model.action_trees import from_decision_tree, n_leaves, packed, to_decision_tree
from eutree.world_model.transitions import earned_nothing, reached_nothing, seen_as

_AT_RANDOM = 0.25  # share of a blind explorer's episodes in which each action is drawn
_LOST = 0.5  # share of explorers that are random trees where a single action was shown
_SINGLE = 0.125  # share of its random trees that are a single action
_CHANGES, _RANDOM_LEAVES = 8, 10  # of a single action into another random tree, and its most leaves
_VISITED = 5000  # latest observations that its thresholds are drawn from
_UNPRUNED = C45Settings(use_penalty=False, prune=False)


@dataclass(frozen=True, kw_only=True)
class PlanningMethod(MethodOfParts):
    """The choices of model-based planning.

    Attributes:
        gathering_episodes: Episodes between two plannings.
        gathering_steps: Steps after which it plans, though fewer episodes were gathered: long ones
            say as much.
        exploration: Probability of a random action in the explorer's episodes.
        planner: How trees are planned, and when a challenger replaces the incumbent.
        max_transitions: Most transitions remembered between two episodes: the most recent
            episodes, and a sample of older ones. None remembers all.
        unpruned_start: Whether the first planning begins from the unpruned tree of the
            demonstrations too. An expert tree that pruning left with a leaf or two has lost
            distinctions that were shown, and single deviations from it find none of them again.
    """

    name: ClassVar[str] = "planning"
    needs: ClassVar[Needs] = Needs(gathering=True, keeps_locks=True)
    deleted: ClassVar[Mapping[str, Any]] = {"planner.world_model": "trees"}

    gathering_episodes: int = 20
    gathering_steps: int = 3000
    exploration: float = 0.1
    planner: Planner = Planner()
    max_transitions: int | None = None
    unpruned_start: bool = True

    def __post_init__(self) -> None:
        check_amounts(self, gathering_episodes=1, gathering_steps=1, max_transitions=1)
        check_number("exploration", self.exploration, low=0.0, high=1.0)

    def start(self, problem: Problem, start: Start) -> "ModelPlanning":
        """Return the learner at its start: the expert tree, if there is one, is the incumbent."""
        return ModelPlanning(self, problem, start)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of a learner's state."""
        forgetting = () if self.max_transitions is None else bounds_part("1")
        return (*TREE_AND_HISTORY, *forgetting, *_PLAN)


_COUNT = Stored("i8", "1", low=0, most="history_n_episodes")
_EPISODES = Stored("i8", "P", low=0, below="history_n_episodes")
_PLAN = (
    Part({
        "actions": Stored("i8", "L", low=0, below="A", at="actions"),
        "plan_incumbent_episodes": _EPISODES._replace(at="plan.incumbent_episodes"),
        "plan_challenger_episodes": _EPISODES._replace(axes="R", at="plan.challenger_episodes"),
        "plan_planned_at": Stored("i8", "1", low=0, most=MOST, at="plan.planned_at"),
        "plan_demonstrations": _COUNT._replace(at="plan.demonstrations"),
        "plan_valid_from": _COUNT._replace(at="plan.valid_from"),
        "plan_informed": Stored("b1", "1", at="_informed"),
    }),
    # Nothing before the first explorer acts, and in the checkpoints of earlier versions.
    Part(
        {"plan_explorer_episodes": _EPISODES._replace(axes="G", at="plan.explorer_episodes")},
        optional=True,
    ),
    # Those of releases that could ask for demonstrations; a run that did cannot go on.
    Part({"plan_assisted_episodes": Stored("i8", (0,))}, optional=True),
    *(
        action_tree_part(f"plan_{name}_", f"plan.{name}", optional=name != "incumbent")
        for name in ("incumbent", "challenger", "explorer", "corrected")
    ),
)  # fmt: skip


class ModelPlanning:
    """A learner that plans whole trees in a world model, and tries them.

    Attributes:
        tree: The incumbent's tree; a value, so keeping a reference freezes it.
        actions: Action of each of its leaves.
        history: All transitions stored so far.
        plan: The incumbent, its challenger, the explorer, and the evidence on them.
        method: How it plans.
        n_actions: Number of actions A.
    """

    def __init__(self, method: PlanningMethod, problem: Problem, start: Start) -> None:
        self.tree, actions, locked = start.first_leaves(problem)
        self.actions = np.array(actions)
        self.n_actions = problem.n_actions
        self._derivation = Derivation.of(problem.schema)
        self._counts = countable(problem.schema)
        self.method = method
        self.plan = Planned(from_decision_tree(self.tree, actions))
        room = method.max_transitions  # of whole episodes: a planner needs them
        forgetting = None if room is None else RecentEpisodes(room)
        self.history = History(self.tree.n_features, 1, forgetting)
        # Where the actions are no expert's, the first explorer acts at random.
        self._informed = start.expert is not None and not start.random
        self._locked = frozenset(locked)  # leaves that stay as they are, without exploration
        self._steps = EpisodeBuffer()
        self._acting: ActionTree | None = None
        # Whether two episodes earned unlike, or a gain, and whether one ended or earned a gain:
        # once true, true for good, but where episodes are forgotten.
        self._differ = self._reached = False
        self._tried: set[tuple[bytes, int]] = set()  # by an explorer, in the present episode
        if start.episodes:
            self.add_demonstrations(start.episodes)

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's episodes; they count as the incumbent's."""
        history = self.history
        for episode in episodes:
            store(history, episode, demonstrated=True)
            history.forget()
        n_episodes = history.n_episodes
        self.plan = replace(
            self.plan, incumbent_episodes=tuple(range(n_episodes)), demonstrations=n_episodes
        )
        if self.method.unpruned_start and history.size:
            shown = grow(
                history.observations, history.actions, n_classes=self.n_actions, settings=_UNPRUNED
            )
            self.plan = replace(self.plan, corrected=from_decision_tree(*shown.to_decision_tree()))

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; choose who acts in it."""
        self._steps.start(observation, generator)
        self._tried.clear()
        plan, method = self.plan, self.method
        uninformed = not self._informed and (plan.explorer is None or plan.knows_nothing)
        curious = self._is_curious()
        unguided = (uninformed or curious) and plan.challenger is None
        self._explores = unguided or generator.random() < method.planner.explorer_share
        self._proves_itself = method.planner.incumbent_acts(plan)
        actor = plan.incumbent if self._proves_itself else plan.evaluated
        self._exploration = 0.0
        blind = uninformed and not curious
        # One action everywhere says nothing of where others lead.
        lost = blind or (n_leaves(plan.incumbent) == 1 and generator.random() < _LOST)
        if self._explores and lost and (plan.explorer is None or not self._counts):
            actor = self._random_tree(generator)
            self._exploration = float(generator.random() < _AT_RANDOM)
        elif self._explores:
            actor = plan.incumbent if plan.explorer is None else plan.explorer
            self._exploration = method.exploration
        if actor is not self._acting:  # most episodes are those of the tree before
            schema = Schema.anonymous(self.tree.n_features, self.n_actions)
            self._acting = actor
            self._actor = TreePolicy(*to_decision_tree(actor, schema.n_features), schema)

    def _is_curious(self) -> bool:
        """Return whether the explorer goes where nobody was, for no episode came to anything."""
        plan = self.plan
        if plan.explorer is None or plan.demonstrations or self._counts:
            return False
        if self._differ and (self._reached or not plan.knows_nothing):
            return False
        known = transitions_of(self.history, self.n_actions)
        self._differ, self._reached = not earned_nothing(known), not reached_nothing(known)
        return not self._differ or (plan.knows_nothing and not self._reached)

    def _random_tree(self, generator: np.random.Generator) -> ActionTree:
        """Return a tree of random actions, with thresholds at what was observed.

        Actions that are drawn at each step undo each other: a car in a valley stays there.
        """
        tree = packed(int(generator.integers(self.n_actions)))
        if self.history.size and generator.random() >= _SINGLE:
            variation = Variation(self.n_actions, _RANDOM_LEAVES, generator)
            visited = self.history.observations[-_VISITED:]
            for _ in range(_CHANGES):
                tree = variation.of(tree, visited) or tree
        return tree

    def act(self, allowed: Booleans | None = None) -> int:
        """Return the acting tree's action for the present observation; the explorer's may err."""
        if self._locked:
            leaf = self.tree.leaf_of(self._steps.present.tolist())
            if leaf in self._locked and (allowed is None or allowed[self.actions[leaf]]):
                return int(self.actions[leaf])
        if self._exploration > 0.0 and self._steps.generator.random() < self._exploration:
            return random_action(self._steps.generator, self.n_actions, allowed)
        action = self._actor.act(self._steps.present.tolist(), allowed)
        if self._explores and self._counts and self._has_tried(action):
            return random_action(self._steps.generator, self.n_actions, allowed)
        return action

    def _has_tried(self, action: int) -> bool:
        """Return whether this episode knows the action here already, and note it.

        The explorer learns nothing within an episode, and would try the same for ever.
        """
        pair = self._steps.present.tobytes(), action
        known = pair in self._tried
        self._tried.add(pair)
        return known

    def observe(self, step: Step) -> None:
        """Take a step."""
        self._steps.add(step)

    def end_episode(self) -> None:
        """Store the episode; it is evidence on the tree that acted."""
        episode = self.history.n_episodes
        store(self.history, self._steps.finish(), generator=self._steps.generator)
        if self.history.n_episodes > episode:  # else it was too long to be stored, or empty
            self.plan = self._told_of(episode)
        kept = self.history.forget()
        if kept is not None:
            self._differ = self._reached = False
            self.plan = self.plan.keeping(kept)

    def _told_of(self, episode: int) -> Planned:
        """Return the plan with what the episode says of the tree that acted in it."""
        if not self._explores:
            return self.plan.with_episode(episode, incumbent=self._proves_itself)
        return self.plan if self.plan.explorer is None else self.plan.with_explored(episode)

    def discard_episode(self) -> None:
        """Forget the episode that is under way."""
        self._steps.clear()

    def update(self, generator: np.random.Generator) -> Update:
        """Plan if it is time: judge the challenger, and plan the next one and the explorer."""
        if len(self._steps):
            raise InvalidArgumentError("update must be called between episodes, not within one")
        history, planner = self.history, self.method.planner
        if not history.size or not planner.due(self.plan, history.n_seen):
            return Update()
        before, challenger = self.plan.incumbent, self.plan.challenger
        shown = self.plan.demonstrations
        plan = planner.plan(self.plan, self._known(), generator, history.n_seen)
        self.plan = replace(plan, planned_at=history.n_seen)
        self._informed = self._informed and plan.demonstrations == shown
        if plan.incumbent is not before:
            tree, actions = to_decision_tree(plan.incumbent, self.tree.n_features)
            if self._locked:  # leaves that are locked in the present tree stay
                kept = {leaf: int(self.actions[leaf]) for leaf in self._locked}
                tree, actions, self._locked = graft(self.tree, kept, tree, actions)
            self.tree, self.actions = tree, actions
        is_new = plan.challenger is not None and plan.challenger is not challenger
        return Update(figures={"challengers": int(is_new), "model_steps": plan.model_steps})

    def imagined(self, n_episodes: int, generator: np.random.Generator) -> PairedRollouts | None:
        """Return where trees can be compared in the world model of all that is stored."""
        if not self.history.size:
            return None
        return self.method.planner.imagined(self.plan, self._known(), n_episodes, generator)

    def decisions(self) -> Decisions:
        """Return the incumbent, with the returns to go of its own episodes."""
        return Decisions(self.tree, self.actions, self._returns(), tuple(sorted(self._locked)))

    def on_trial(self) -> Decisions | None:
        """Return the challenger that waits for its evaluation to end; None if there is none.

        Where leaves are locked it could not be taken as it is: None.
        """
        if self.plan.challenger is None or self._locked:
            return None
        tree, actions = to_decision_tree(self.plan.challenger, self.tree.n_features)
        return Decisions(tree, actions, None, ())

    def state(self) -> Arrays:
        """Return all that the learner knows, between two episodes."""
        return arrays_of(self, self.method.parts)

    def _known(self) -> Transitions:
        known = seen_as(self._derivation, transitions_of(self.history, self.n_actions))
        return replace(known, counted=self._counts)

    def _returns(self) -> LeafStatistics | None:
        """Return the returns of each action in the incumbent's own episodes; None without any."""
        history = self.history
        mine = np.isin(history.episodes, self.plan.incumbent_episodes) & ~history.demonstrated
        if not mine.any():
            return None
        return returns_by_action(
            self.tree.leaf_index(history.observations[mine]),
            history.actions[mine],
            transitions_of(history, self.n_actions).returns_to_go[mine],
            n_leaves=self.tree.n_leaves,
            n_actions=self.n_actions,
        )


DEFAULT = PlanningMethod()
