"""Where a run acts and is evaluated: the curve, the front, the judgement, the proofs.

No frozen tree plays the same start twice.
"""

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from eutree.compression.episodes import FrontEntry
from eutree.compression.playing import Ground
from eutree.errors import InvalidArgumentError
from eutree.evaluation import CurvePoint, Evaluation
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import Stream
from eutree.learners import Learner
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.training.handover import AS_LEARNED, Duel, Handover, Judgement, judge, judged
from eutree.training.phases import ALONG, FEW, Plan, RunState, generator_of, left, within
from eutree.training.proposals import identity, key

if TYPE_CHECKING:
    from eutree.compression.front import Front
    from eutree.proof import Certificate


KNOWN = 16  # trees whose episodes are remembered

Player = Callable[[TreePolicy, Sequence[int], int], Evaluation]  # (policy, starts, seed)


@dataclass(frozen=True)
class Arena:
    """Where a run acts.

    Attributes:
        env: Where episodes are gathered and raced.
        play: How to play a frozen policy from some starts of an evaluation with a seed.
        ground: How to let many frozen policies play beside each other, from starts with a seed.
        return_range: Lowest and highest return of an episode; None where they are not known.
    """

    env: GuardedEnv
    play: Player
    ground: Callable[[int], Ground]
    return_range: tuple[float, float] | None = None


class PlayedStarts:
    """Episodes of frozen trees from numbered starts, and their number.

    An episode played once is counted once, though its return may be lost between two parts of a run
    and it has to be played again.

    Attributes:
        counts: How many starts, the first ones, each tree has played, by a digest; the last is the
            latest.
        episodes: Episodes played.
        steps: Their steps.
        seconds: Their time by the clock.
    """

    def __init__(self) -> None:
        self._known: dict[str, Evaluation] = {}
        self.counts: dict[str, int] = {}
        self.episodes = self.steps = 0
        self.seconds = 0.0

    def known(self, policy: TreePolicy, seed: int) -> int:
        """Return from how many starts, the first ones, a policy has played."""
        return self.counts.get(_digest(policy, seed), 0)

    def of(self, policy: TreePolicy, starts: Sequence[int], seed: int, arena: Arena) -> Evaluation:
        """Return a policy's episodes from some starts, ascending, of an evaluation with this seed.

        Those before them are played, too, if they were not yet.
        """
        asked, n = _digest(policy, seed), starts[-1] + 1
        found, counted = self._known.get(asked), self.counts.get(asked, 0)
        have = 0 if found is None else found.episodes
        if found is None or n > have:
            begin = time.monotonic()
            more = arena.play(policy, range(have, n), seed)
            self.seconds += time.monotonic() - begin
            found = more if found is None else Evaluation.join([found, more])
        self.steps += int(found.lengths[counted:].sum())
        self.episodes += max(found.episodes - counted, 0)
        self._known.pop(asked, None)
        self.counts.pop(asked, None)  # the latest comes last
        self._known[asked], self.counts[asked] = found, max(found.episodes, counted)
        for old in list(self.counts)[:-KNOWN]:
            del self.counts[old]
            self._known.pop(old, None)
        return found.of_episodes(starts)


def _digest(policy: TreePolicy, seed: int) -> str:
    return hashlib.sha256(identity(policy) + seed.to_bytes(8, "big")).hexdigest()[:16]


TRIAL = 8  # of what is left where episodes are dear, the share of each of two trees
EARLIER = 3  # trees of a run that smaller ones are made of: the last, and those before it


class ProvenFirst:
    """Which of several policies is proven to have a property.

    Args:
        environment: Where they act.
        question: The property (see :mod:`eutree.proof.properties`); the plant's own for ``""``.

    Raises:
        InvalidArgumentError: No plant is known for the environment, or the text is no property.
    """

    def __init__(self, environment: EnvironmentSpec | None, question: str) -> None:
        from eutree.proof import plant_of
        from eutree.proof.properties import parse

        plant = plant_of(environment)
        if plant is None:
            raise InvalidArgumentError(
                f"prefer_proven needs a plant, which says how states move; none is known for "
                f"{environment}"
            )
        self._plant = plant
        self._asked = parse(question or plant.question, plant.schema)

    def certificate(self, policy: TreePolicy) -> "Certificate | None":
        """Return the proof of a policy; None where it is not proven, or cannot be."""
        from eutree.proof import prove

        if not policy.features.is_identity:
            return None
        found = prove(policy, self._plant, self._asked)
        return found if found.proven else None

    def first(self, policies: Iterable[TreePolicy]) -> "tuple[int, Certificate] | None":
        """Return the number of the first policy that is proven, and its proof; None if none is."""
        for number, policy in enumerate(policies):
            found = self.certificate(policy)
            if found is not None:
                return number, found
        return None


class Evaluations:
    """Evaluates the frozen policy of a run, on the same episodes at each point of it.

    Args:
        plan: The run's seed, and whether success must not fall.
        state: Where the run stands; each evaluation is noted there.

    Attributes:
        curve: Evaluations so far.
        kept: With ``keep_success`` the policy that success must not fall from, and its successes.
        earlier: The last trees of the curve that differ, the latest last, where a front follows.
        front: The learned tree and the best of each size; empty before it is known.
        picked: The tree of the front, or the one on trial, that meets the start; None for neither.
        judgement: The result against the start; None before it is known.
        played: The episodes of frozen trees.
        counts: Their counts when the state counted them last: what an interruption cut short is
            played once more.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._plan = plan
        self._handover = plan.handover or Handover(episodes=0)
        self._state = state
        self.played = PlayedStarts()
        self.counts: dict[str, int] = {}
        self._counted = 0
        self.curve: list[CurvePoint] = []
        self.kept: tuple[TreePolicy, int] | None = None
        self.earlier: list[TreePolicy] = []
        self.front: tuple[FrontEntry, ...] = ()
        self.picked: TreePolicy | None = None
        self._room = 0  # episodes that the judgement may take where they are dear
        self.judgement: Judgement | None = None

    def begin_again(self) -> None:
        """Forget how the run ended that is now made longer."""
        self.front, self.picked, self.judgement = (), None, None

    def add(self, policy: TreePolicy, arena: Arena) -> None:
        """Evaluate the learned policy: one more point of the curve."""
        state, steps = self._state, self.played.steps
        state.whole = True  # evaluating changes nothing of the run
        evaluation = self._evaluated(policy, Stream.EVALUATION, arena)
        if self._plan.keep_success:
            policy, evaluation = self._keep(policy, evaluation, arena)
        self._count()
        state.move(evaluation_steps=state.at.evaluation_steps + self.played.steps - steps)
        state.whole = False
        point = CurvePoint(
            episode=state.at.episode,
            steps=state.num_timesteps,
            success_rate=evaluation.success_rate,
            mean_return=evaluation.mean_return,
            n_leaves=policy.n_leaves,
        )
        self.curve.append(point)
        self._remember(policy)
        state.move(evaluated_at=state.at.episode)
        state.note("evaluation", vars(point) | {"mean_length": evaluation.mean_length})

    def make_front(
        self,
        learned: TreePolicy,
        first: TreePolicy,
        learner: Learner,
        arena: Arena,
        keeping: Callable[[TreePolicy], TreePolicy],
        tried: TreePolicy | None,
    ) -> None:
        """Find the best tree of each size, and pick one; neither where steps are too few.

        ``keeping`` makes trees keep the run's rules. The one that was ``tried`` last plays, too.
        """
        from eutree.training.front import IMAGINING, Extent, front_of_run

        plan, handover, at, state = self._plan, self._handover, self._state.at, self._state
        state.whole = True
        ground = arena.ground(plan.seed)
        steps = handover.steps_of_front(at.steps, side_by_side=ground.side_by_side)
        if plan.is_dear and handover.front_steps is None:
            steps = min(steps, int(self._left() / 2 * at.steps / max(at.episode, 1)))
        time = self._seconds_left() / 4  # for imagining, and as much for playing
        if plan.seconds is not None:
            steps = min(steps, within(time, self.played.steps, self.played.seconds))
        # A limit that the learned tree exceeds is kept, be the front as small as it may.
        too_large = learned.n_leaves > (handover.max_leaves or learned.n_leaves)
        extent = Extent.of(steps, at.steps, at.episode, least=2 * too_large)
        if extent is not None:
            if plan.seconds is not None:
                extent = replace(extent, imagined=min(extent.imagined, int(time * IMAGINING)))
            found = front_of_run(
                [learned, *reversed(self.earlier)],
                first,
                learner,
                ground,
                extent,
                keeping,
                tried=tried,
                max_leaves=handover.max_leaves,
                success_margin=handover.success_margin,
                generator=generator_of(plan.seed, Stream.FRONT, 0),
            )
            self.front, self.picked = found.entries, self._preferred(found, arena)
        state.whole = False
        played = state.at.played_episodes + ground.episodes
        so_far = state.at.front_steps + ground.steps  # a run that was made longer had one before
        state.move(fronted=True, front_steps=so_far, played_episodes=played)
        if self.front and self.picked is not None:
            entries = [one.facts() for one in self.front]
            state.note("front", {"front": entries, "picked": self.picked.n_leaves})

    def _proven(self, arena: Arena) -> ProvenFirst | None:
        """Return the test that tells proven trees from others, where they are preferred."""
        question = self._handover.prefer_proven
        return None if question is None else ProvenFirst(arena.env.spec, question)

    def _preferred(self, found: "Front", arena: Arena) -> TreePolicy | None:
        """Return the pick or, where proven trees are preferred, the best of those, if any is."""
        proven, picked = self._proven(arena), found.picked
        if proven is None or picked is None:
            return picked
        others = sorted(found.entries[1:], key=lambda one: -one.mean_return)
        most = self._handover.max_leaves
        fit = [one.policy for one in others if most is None or one.policy.n_leaves <= most]
        trees = [picked, *fit]
        first = proven.first(trees)
        return picked if first is None else trees[first[0]]

    def _remember(self, policy: TreePolicy) -> None:
        """Keep the last few trees that differ: smaller ones are made of them at the end."""
        is_new = not self.earlier or key(self.earlier[-1]) != key(policy)
        if self._handover.has_front and is_new:
            self.earlier = [*self.earlier, policy][-EARLIER:]

    def judge(
        self,
        first: TreePolicy,
        policy: TreePolicy,
        challengers: int,
        arena: Arena,
        *,
        given: bool = True,
        tried: TreePolicy | None = None,
        seen: Callable[..., tuple[float, float] | None] = lambda *trees: None,
    ) -> None:
        """Decide whether the result or the start is handed over, on episodes that chose nothing.

        The start ``first`` has less to say where nobody has ``given`` it. Without a front the one
        that was ``tried`` last takes the place of the result if it earns more. ``seen`` tells the
        lowest and highest return of trees in the run.
        """
        self._state.whole = True
        self._room, picked, beside = self._left(), self.picked, (0, 0)
        if tried is not None:
            ground = arena.ground(self._plan.seed)
            if self._is_better(tried, policy, first, ground):
                picked = policy = tried
            beside = ground.steps, ground.episodes
        steps = self.played.steps
        if identity(policy) == identity(first):
            judgement = Judgement.same(challengers=challengers)
        elif (handover := self._plan.handover) is None:
            pair = [self._evaluated(one, self._fresh, arena) for one in (first, policy)]
            both = range(min(one.episodes for one in pair))  # the clock may have allowed for less
            pair = [one.of_episodes(both) for one in pair]
            found = judged(*pair, known=arena.return_range, challengers=challengers)
            judgement = replace(found, why=AS_LEARNED)
        else:
            at, seed = self._state.at, self._seed(self._fresh)
            most = handover.pairs(at.episode)
            duel = Duel(
                first,
                policy,
                lambda tree, starts: self.played.of(tree, starts, seed, arena),
                most=self._pairs(first, policy, most, arena, beyond=int(max(at.lived, FEW))),
                patience=self._pairs(first, policy, most, arena),
                steps=handover.steps(at.steps + at.racing_steps),
                seen=None if arena.return_range else seen(first, policy),
            )
            sizes = first.n_leaves, policy.n_leaves
            known = arena.return_range
            judgement = judge(
                handover, duel, sizes, known=known, challengers=challengers, given=given
            )
            judgement = replace(judgement, steps=self.played.steps - steps)
            proven = self._proven(arena)
            if proven is not None:
                sure = tuple(proven.certificate(one) is not None for one in (first, policy))
                judgement = judgement.of_proven(*sure)
        self._state.whole = False
        self._count()
        # All at once, when nothing can go wrong: else a run that goes on would count it twice.
        self.judgement, self.picked, at = judgement, picked, self._state.at
        self._state.move(
            judged=True,
            evaluation_steps=at.evaluation_steps + self.played.steps - steps - judgement.steps,
            front_steps=at.front_steps + beside[0],
            played_episodes=at.played_episodes + beside[1],
        )
        self._state.note("judgement", judgement.facts())

    def _is_better(
        self, tried: TreePolicy, policy: TreePolicy, first: TreePolicy, ground: Ground
    ) -> bool:
        """Return whether, without a front, the tree on trial does better than the result.

        Neither is the start.

        Their episodes are beside those that the judgement may take, few as these may be.
        """
        from eutree.training.front import FEWEST, earns_more

        plan, handover = self._plan, self._handover
        guarded = plan.keep_success or handover.prefer_proven is not None
        without_front = handover.has_front and not self.front
        known = identity(policy) in (identity(first), identity(tried))
        if guarded or known or not without_front:
            return False
        starts = max(self._room // TRIAL, 2) if plan.is_dear else FEWEST
        if plan.seconds is not None:
            time = self._seconds_left() / 4
            starts = min(starts, within(time, self.played.episodes, self.played.seconds))
        return earns_more(tried, policy, ground, starts)

    @property
    def _fresh(self) -> Stream:
        """The episodes that chose nothing: where they are dear, those of the curve are such."""
        shared = self._plan.is_dear and not self._plan.keep_success
        return Stream.EVALUATION if shared else Stream.JUDGING

    def _pairs(
        self, first: TreePolicy, policy: TreePolicy, most: int, arena: Arena, *, beyond: int = 0
    ) -> int:
        """Return the most pairs that start and result may play: those played count again.

        Where episodes are dear ``beyond`` more may be played than is in proportion.
        """
        plan, seed = self._plan, self._seed(self._fresh)
        more = 2 * most
        if plan.is_dear and self._handover.episodes is None:
            more = min(more, self._room + beyond)
        if plan.seconds is not None:
            self.played.of(first, [0], seed, arena)  # an episode at least, which tells the time
            time = self._seconds_left()
            more = min(more, within(time, self.played.episodes, self.played.seconds))
        few, many = sorted(self.played.known(one, seed) for one in (first, policy))
        alone = few + more  # as many as the one that has fewer can reach by itself
        return max(min(most, alone if alone <= many else (few + many + more) // 2), 1)

    def _left(self) -> int:
        """Return how many episodes may still be played where they are dear."""
        at = self._state.at
        return left(at.lived, at.played_episodes)

    def _seconds_left(self) -> float:
        """Return the time that is left for the end of the run."""
        return max((self._plan.seconds or 0.0) - self._state.at.seconds, 0.0)

    def _count(self) -> None:
        """Count the episodes played since this was asked last."""
        state, played = self._state, self.played
        state.move(played_episodes=state.at.played_episodes + played.episodes - self._counted)
        self._counted, self.counts = played.episodes, dict(played.counts)

    def _keep(
        self, policy: TreePolicy, evaluation: Evaluation, arena: Arena
    ) -> tuple[TreePolicy, Evaluation]:
        """Return the policy if it succeeds as often as the kept one, in the same episodes."""
        count = None if evaluation.successes is None else int(evaluation.successes.sum())
        if count is None:
            raise InvalidArgumentError(
                "keep_success needs an environment that reports success (info['is_success'])"
            )
        if self.kept is not None:
            before = self._evaluated(self.kept[0], Stream.EVALUATION, arena)
            both = range(min(before.episodes, evaluation.episodes))  # the clock may allow for fewer
            pair = [one.of_episodes(both).successes for one in (before, evaluation)]
            kept, found = (0 if one is None else int(one.sum()) for one in pair)
            if found < kept:
                self._state.note("kept", {"successes": kept, "successes_refused": found})
                return self.kept[0], before
        self.kept = policy, count
        return policy, evaluation

    def _evaluated(self, policy: TreePolicy, stream: Stream, arena: Arena) -> Evaluation:
        """Evaluate a policy, from as many starts as the plan and the clock allow."""
        plan, at, seed, played = self._plan, self._state.at, self._seed(stream), self.played
        starts = plan.evaluation_episodes
        if plan.seconds is not None:
            played.of(policy, [0], seed, arena)  # an episode at least, which tells the time
            time = ALONG * max(at.seconds, plan.seconds / 10) - played.seconds
            more = within(time, played.episodes, played.seconds) if time > 0.0 else 0
            starts = min(starts, max(played.known(policy, seed) + more, 1))
        return played.of(policy, range(starts), seed, arena)

    def _seed(self, stream: Stream) -> int:
        return episode_seed(self._plan.seed, 0, stream)
