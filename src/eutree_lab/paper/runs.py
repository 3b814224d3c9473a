"""One run of an experiment: its spec, as data, and its record, as a checked document.

Runs are shared: Table 2 and the compression claim read the runs of Figure 2. A run is named by
everything that decides its result, so a folder of results never holds one under a wrong name.
"""

import hashlib
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import gymnasium
import msgspec
from msgspec import UNSET, UnsetType

from eutree.compression import compress
from eutree.data import Demonstrations
from eutree.envs.experts import experts_for
from eutree.evaluation import evaluate
from eutree.files import Document
from eutree.interaction.making import make
from eutree.learners import fit_expert_tree
from eutree.policies import TreePolicy
from eutree.recording import record
from eutree.schema import EnvironmentSpec
from eutree.training import LearningResult, Run, learn
from eutree_lab.paper.finals import FINALS

STARTS = {"c-u-tree": "nothing", "eu-tree-dt": "tree", "eu-tree": "tree+demos"}
DEMONSTRATED_SPEED = 3.2  # m/s, the paper's


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """Everything that decides the result of one run.

    Attributes:
        environment: Id of the environment.
        learner: ``"expert"`` (no learning), or one of the paper's three
            learners, which are starts: ``"c-u-tree"``, ``"eu-tree-dt"`` or ``"eu-tree"``.
        preset: Settings of the learner; empty for the expert tree alone.
        opponent_speed: Speed of the opponents while learning and evaluating, in m/s.
        demonstrations: Episodes of the scripted demonstrator, always at 3.2 m/s.
        episodes: Episodes of learning.
        evaluate_every: Episodes between two frozen evaluations.
        evaluation_episodes: Episodes of each frozen evaluation.
        final_episodes: Episodes of the evaluation of the final policy.
        seed: Seed of demonstrations, learning and evaluations.
    """

    environment: str
    learner: str
    preset: str
    opponent_speed: float = DEMONSTRATED_SPEED
    demonstrations: int = 15
    episodes: int = 400
    evaluate_every: int = 20
    evaluation_episodes: int = 100
    final_episodes: int = 1000
    seed: int = 0

    @property
    def name(self) -> str:
        """A file name that tells the run apart from every other."""
        digest = hashlib.sha256(repr(sorted(asdict(self).items())).encode()).hexdigest()[:12]
        return f"{self.learner}-{self.preset or 'c45'}-{self.seed:02d}-{digest}"


class Performance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a policy did: share of successes, mean return, and its number of leaves."""

    success: float
    mean_return: float
    n_leaves: int


class Point(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One frozen evaluation along a run."""

    episode: int
    success: float
    mean_return: float
    n_leaves: int


class RunRecord(Document, frozen=True, kw_only=True):
    """The record of a run.

    Attributes:
        spec: Settings of the run.
        expert: The expert tree in this environment; None for the C. U-Tree.
        curve: Frozen evaluations along the way; empty for the expert tree alone.
        final: The final policy on fresh episodes.
        compressed: The compressed final policy on the same episodes; None where none was learned.
        agreement: Share of recorded observations on which compression kept the action.
        finals: Performance of the policy that each rule of ``eutree_lab.paper.finals`` chooses,
            on fresh episodes; older records and those of the expert tree alone have none.
    """

    FORMAT: ClassVar[str] = "eutree/experiment-run"
    VERSION: ClassVar[int] = 1

    spec: RunSpec
    expert: Performance | None
    curve: list[Point]
    final: Performance
    compressed: Performance | None
    agreement: float | None
    finals: dict[str, Performance] | UnsetType = UNSET


@dataclass(eq=False)
class _Kept:
    """The policies that were evaluated along a run, in the order of its curve."""

    policies: list[TreePolicy] = field(default_factory=list)

    def __call__(self, run: Run) -> None:
        if len(run.curve) > len(self.policies):
            self.policies.append(run.policy())


def run(spec: RunSpec) -> RunRecord:
    """Do one run; the same spec gives the same record, whichever process does it."""
    env = _environment(spec, spec.opponent_speed)
    kept = _Kept()
    if spec.learner == "c-u-tree":
        return _record(spec, env, None, _learn(spec, env, None, None, kept), kept)
    demonstrations = demonstrate(spec)
    expert = fit_expert_tree(demonstrations)
    if spec.learner == "expert":
        return _record(spec, env, expert, None, kept)
    return _record(spec, env, expert, _learn(spec, env, demonstrations, expert, kept), kept)


def demonstrate(spec: RunSpec) -> Demonstrations:
    """Return the demonstrations, at 3.2 m/s."""
    return _shown(
        RunSpec(
            environment=spec.environment,
            learner="expert",
            preset="",
            demonstrations=spec.demonstrations,
            seed=spec.seed,
        )
    )


@lru_cache(maxsize=16)  # arms and readings of a seed share them, and come one after the other
def _shown(spec: RunSpec) -> Demonstrations:
    shown = _environment(spec, DEMONSTRATED_SPEED)
    gate = experts_for(spec.environment)["gate"]
    return record(shown, gate, episodes=spec.demonstrations, seed=spec.seed)


def _learn(
    spec: RunSpec,
    env: gymnasium.Env[Any, Any],
    demonstrations: Demonstrations | None,
    expert: TreePolicy | None,
    kept: _Kept,
) -> LearningResult:
    return learn(
        env,
        demonstrations=demonstrations,
        expert=expert,
        method=spec.preset,
        start=STARTS[spec.learner],
        episodes=spec.episodes,
        evaluate_every=spec.evaluate_every,
        evaluation_episodes=spec.evaluation_episodes,
        judge_episodes=0,
        seed=spec.seed,
        on_progress=kept,
    )


def _environment(spec: RunSpec, speed: float) -> gymnasium.Env[Any, Any]:
    """Make the environment of the run at an opponent speed."""
    return make(EnvironmentSpec(spec.environment, {"opponent_speed": speed}))


def _record(
    spec: RunSpec,
    env: gymnasium.Env[Any, Any],
    expert: TreePolicy | None,
    result: LearningResult | None,
    kept: _Kept,
) -> RunRecord:
    """Evaluate the policies on fresh episodes and put everything in a record."""

    def performance(policy: TreePolicy) -> Performance:
        measured = evaluate(policy, env, episodes=spec.final_episodes, seed=spec.seed)
        return Performance(
            float(measured.success_rate or 0.0), measured.mean_return, policy.n_leaves
        )

    of_expert = None if expert is None else performance(expert)
    if result is None:
        if of_expert is None:
            raise TypeError("a record needs an expert tree or a learning result")
        return RunRecord(
            spec=spec, expert=of_expert, curve=[], final=of_expert, compressed=None, agreement=None
        )
    chosen = {name: rule(_points(result)) for name, rule in FINALS.items()}
    measured = {index: performance(kept.policies[index]) for index in set(chosen.values())}
    small, report = compress(result.policy, result.history.observations)
    return RunRecord(
        spec=spec,
        expert=of_expert,
        curve=_points(result),
        final=performance(result.policy),
        compressed=performance(small),
        agreement=report.agreement,
        finals={name: measured[index] for name, index in chosen.items()},
    )


def _points(result: LearningResult) -> list[Point]:
    """Return the frozen evaluations of a run."""
    return [
        Point(p.episode, float(p.success_rate or 0.0), p.mean_return, p.n_leaves)
        for p in result.curve
    ]
