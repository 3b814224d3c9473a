"""``prove``: a policy, a plant and a property make a certificate."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.inspection import Region
from eutree.policies import TreePolicy
from eutree.proof.certificate import (
    NEVER,
    PROOF,
    PROVEN,
    REFUTED,
    UNDECIDED,
    Certificate,
    Pieces,
    Starts,
    pictures_of_pieces,
)
from eutree.proof.intervals import Intervals, Truth, middle
from eutree.proof.invariant import StateGrid, largest_invariant, pictures_of_grid
from eutree.proof.layers import Layers, worst_starts
from eutree.proof.plant import Plant, State
from eutree.proof.properties import EVER, EpisodeProperty, parse
from eutree.proof.reach import Acting, Effort, Reach
from eutree.proof.replay import MOST_BOXES, breaking_seed, replay, starts_among
from eutree.trees.text import derived_features
from eutree.validation import check_kind

_TRIES = 20  # starts of undecided pieces that are replayed
_HALVINGS = 50  # of the cells along axes at most, which takes them near the rounding of doubles
_SHOWN = 5e-4  # of the starts: least share that is open and said beside those that fail
_BEGUN = 16  # episodes: real numbers that are drawn are hardly ever whole
_SUMMED = 1e-9  # of the steps: greatest error of adding up shares


class NeedsEpisodesError(InvalidArgumentError):
    """A property of returns of which a plant says nothing; episodes can answer it."""


def prove(
    policy: TreePolicy,
    plant: Plant,
    question: str | EpisodeProperty | None = None,
    *,
    effort: Effort | None = None,
) -> Certificate:
    """Prove a property of all episodes of a policy in a plant, or refute it.

    A proof is about the program that runs: doubles in the environment's order of operations, and
    observations of its precision. A counterexample is a start from which the real environment
    was replayed and breaks the property.

    Args:
        policy: A policy that decides by the present observation.
        plant: How boxes of states move.
        question: A property (see :mod:`eutree.proof.properties`); the plant's own by default.
        effort: How far to go before a piece of the starts is left undecided.

    Raises:
        InvalidArgumentError: The text is no property, the plant cannot answer it, or the policy
            is not one of the plant's environment.
        NeedsEpisodesError: Only episodes can answer it.
    """
    effort = check_kind("effort", effort or Effort(), Effort)
    text = check_kind("plant", plant, Plant).question if question is None else question
    if not isinstance(text, str):
        check_kind("question", text, EpisodeProperty)
    plant.check_fits(policy)
    asked = parse(text, plant.schema) if isinstance(text, str) else text
    if (own := plant.certify(policy, asked, effort.refinements)) is not None:
        return own
    is_known = plant.reward is not None and plant.limit is not None
    if of_mean := asked.kind == "returns" and asked.chance is None and is_known:
        found = prove(policy, plant, "arrives", effort=effort)
        if "mean_return" in found.bounds:
            return _of_return(found, asked, plant)
    limit = plant.limit if asked.kind == "arrives" else plant.time_limit
    horizon = (limit or EVER) if asked.horizon is None else asked.horizon
    if asked.kind == "arrives" and horizon != EVER:
        horizon = min(horizon, plant.time_limit or horizon)  # no episode arrives later
    if asked.kind == "returns":
        raise NeedsEpisodesError(
            f"property {asked.text!r} is about chance or returns, of which the plant of "
            f"{plant.environment} says nothing{' of starts at whole numbers' if of_mean else ''}; "
            "let episodes answer (--sampled)"
        )
    if asked.kind not in ("arrives", "stays", "avoids"):
        raise InvalidArgumentError(
            f"property {asked.text!r} is about chance, and nothing in the plant of "
            f"{plant.environment} is left to chance but the start; ask whether it arrives, stays "
            "in or avoids"
        )
    if asked.kind == "arrives" and horizon != EVER and type(plant).arrives is Plant.arrives:
        raise InvalidArgumentError(
            f"property {asked.text!r} must be about a task with a goal, which "
            f"{plant.environment} has not; ask whether it stays in or avoids"
        )
    proof = _Proof(policy, plant, asked, horizon, effort)
    if horizon != EVER:
        # Layers are cut by the leaves' boxes: of measured features, which are the state itself.
        is_seen = type(plant).observe is Plant.observe
        measured = is_seen and not derived_features(policy.tree, policy.schema)
        by_axes = bool(plant.axes) and asked.kind != "arrives" and measured
        return proof.by_layers() if by_axes else proof.certificate()
    if asked.kind == "arrives":
        raise InvalidArgumentError(
            f"property {asked.text!r} must be about a number of steps: add 'within N steps'"
        )
    return proof.for_ever()


def _of_return(found: Certificate, asked: EpisodeProperty, plant: Plant) -> Certificate:
    """Return the certificate of the mean return over all starts that follows from that of steps."""
    low, high = found.bounds["mean_return"]
    least = asked.least or 0.0
    verdict = PROVEN if low >= least else REFUTED if high < least else UNDECIDED
    words = f"over all starts of {plant.environment} {_said(verdict, f'it {asked.text}')}: "
    words += f"its mean return is in [{low:.6g}, {high:.6g}]"
    share = float(verdict == UNDECIDED)
    return replace(
        found, sentence=words, verdict=verdict, undecided=share, counterexample=None, starts=None
    )


def _said(verdict: str, statement: str) -> str:
    words = {PROVEN: "{}", REFUTED: "it is not true that {}", UNDECIDED: "whether {} is open"}
    return words[verdict].format(statement)


class _Proof:
    """A property that is decided by following boxes for some steps."""

    def __init__(
        self, policy: TreePolicy, plant: Plant, asked: EpisodeProperty, horizon: int, effort: Effort
    ) -> None:
        self._policy, self._plant, self._asked = policy, plant, asked
        self._horizon, self._effort = horizon, effort
        self._arriving = asked.kind == "arrives"

    def certificate(self) -> Certificate:
        """Return the answer."""
        plant = self._plant
        if not self._arriving:
            self._check_start()
        reach = Reach(
            Acting(self._policy, plant),
            plant,
            *(plant.arrives, plant.fails) if self._arriving else (self._broken, plant.ends),
            horizon=self._horizon,
            effort=self._effort,
        )
        pieces = reach.pieces()
        shares = _shares(pieces, plant)
        fails = pieces.first == NEVER if self._arriving else pieces.last != NEVER
        open_ = (pieces.first != NEVER) & (pieces.last == NEVER)  # perhaps
        start = self._counterexample(pieces, fails, open_)
        verdict = REFUTED if start else UNDECIDED if (fails | open_).any() else PROVEN
        is_shared = verdict == PROVEN or not self._whole.any()
        share = shares[open_].sum() if is_shared else verdict == UNDECIDED
        undecided = min(float(share), 1.0)
        bounds = self._bounds(pieces, shares) if self._arriving else {}
        more, said = "", None
        if verdict == PROVEN and self._arriving:
            said = f"arrives within {bounds['steps'][1]} steps" if "steps" in bounds else "arrives"
        elif verdict == REFUTED and fails.any() and is_shared:
            more = f": not from {100 * float(shares[fails].sum()):.3g} % of all starts"
            more += " at least" if undecided > _SHOWN else ""
        elif verdict == UNDECIDED and is_shared:
            more = f" for a share of {undecided:.3g} of them"
        if "mean_return" in bounds:
            low, high = bounds["mean_return"]
            more += f"; the mean return over all starts is in [{low:.6g}, {high:.6g}]"
        return self._certificate(
            verdict, more, said=said, bounds=bounds, undecided=undecided, counterexample=start,
            worst_start=self._worst(pieces) if self._arriving else None, pieces=pieces,
            starts=starts_among(pieces, fails | open_) if is_shared else None,
            pictures=pictures_of_pieces(pieces, fails, open_),
            work={"pieces": len(pieces.first), "box_steps": reach.box_steps},
        )  # fmt: skip

    def _certificate(
        self, verdict: str, more: str = "", *, said: str | None = None, **fields: Any
    ) -> Certificate:
        """Return a certificate whose sentence ends with ``more``."""
        every = f"from every start of {self._plant.environment} it {said or self._asked.text}"
        return Certificate(_said(verdict, every) + more, PROOF, verdict, **fields)

    def by_layers(self) -> Certificate:
        """Return whether the conditions hold for some steps, from boxes along the plant's axes.

        Cells are halved while that may help and a next time, four times the work, is in the effort.
        """
        self._check_start()
        plant, steps, spent = self._plant, 0, 0
        for refine in (1 << k for k in range(_HALVINGS)):
            layers = Layers(self._policy, plant, refine)
            left = self._effort.box_steps - spent
            steps = max(steps, layers.keeps(self._broken, self._horizon, left))
            spent += layers.box_steps
            work = {"boxes": layers.most, "box_steps": spent, "steps": steps, "refined": refine}
            if steps == self._horizon:
                return self._certificate(PROVEN, work=work)
            if refine == 1:
                acting = Acting(self._policy, plant)
                starts = worst_starts(acting, plant, self._harm, self._horizon, self._whole)
                if found := self._broken_from(self._real(starts, *np.array(plant.start).T)):
                    return self._certificate(REFUTED, counterexample=found, work=work)
            if layers.is_finest or 5 * spent > self._effort.box_steps:
                break
        more = f"; it is proven for the first {steps} steps"
        return self._certificate(UNDECIDED, more, undecided=1.0, work=work)

    def for_ever(self) -> Certificate:
        """Return whether the conditions hold at every step of an episode without an end."""
        plant = self._plant
        self._check_start()
        acting = Acting(self._policy, plant)
        for refine in self._effort.refinements:
            grid = StateGrid.of(plant, refine)
            every = grid.boxes(np.arange(grid.n_cells))
            keeps = (~self._broken(every)).surely
            found = largest_invariant(acting, plant, keeps, grid)
            if not found.undecided:
                break
        work = {"cells": grid.n_cells, "safe_cells": int(found.safe.sum()), "sweeps": found.sweeps}
        pictures = pictures_of_grid(plant, found)
        if not found.undecided:
            return self._certificate(PROVEN, pictures=pictures, work=work)
        box = [(one.low, one.high) for one in grid.boxes(np.flatnonzero(found.open_cells))]
        starts = Starts(plant.state, *np.array(box).transpose(1, 2, 0)[:, :MOST_BOXES])
        seed = breaking_seed(plant, self._policy, self._broken)
        verdict = UNDECIDED if seed is None else REFUTED
        more = f" for a share of {found.undecided:.3g} of the cells with starts"
        if seed is not None:
            more = f": the episode of seed {seed['seed']} does not"
        return self._certificate(
            verdict,
            more,
            undecided=found.undecided,
            counterexample=seed,
            starts=None if self._whole.any() else starts,
            pictures=pictures,
            work=work,
        )

    @property
    def _region(self) -> Region:
        region = self._asked.region
        assert region is not None  # noqa: S101 - the parser gives one to these kinds
        return region

    def _harm(self, seen: Floats) -> Floats:
        """Return how far measures [m, N] are beyond the bounds of the property, shape [N]."""
        low, high = (np.asarray(end)[:, None] for end in (self._region.low, self._region.high))
        scale = np.where(np.isfinite(high - low), high - low, 1.0)
        beyond: Floats = (np.maximum(low - seen, seen - high) / scale).max(axis=0)
        return beyond if self._asked.kind == "stays" else -beyond

    def _broken(self, state: State) -> Truth:
        """Return whether states break the condition that must hold at every step."""
        size = np.shape(state[0].low)
        inside = _inside(self._region, map(Intervals.of, self._plant.measure(state)), size)
        return ~inside if self._asked.kind == "stays" else inside

    def _check_start(self) -> None:
        start = np.array(self._plant.start)[:, :, None]
        if self._broken([Intervals(low, high) for low, high in start]).maybe.any():
            raise InvalidArgumentError(
                f"property {self._asked.text!r} must hold where episodes begin, in "
                f"{dict(zip(self._plant.state, self._plant.start, strict=True))}"
            )

    def _counterexample(
        self, pieces: Pieces, fails: Booleans, open_: Booleans
    ) -> dict[str, float] | None:
        """Return a start from which the real environment breaks the property, and when."""
        failing = self._middles(pieces, fails)
        found = self._broken_from(failing)
        if len(failing) and found is None:
            raise InvalidArgumentError(
                f"plant must move as {self._plant.environment} does, but it refutes "
                f"{self._asked.text!r} where the environment keeps it; see check_plant"
            )
        return found or self._broken_from(self._middles(pieces, open_))

    @cached_property
    def _whole(self) -> Booleans:
        """Which numbers of the start are drawn as whole ones, shape [d]: they have no shares."""
        env, states = self._plant.make(), []
        for seed in range(_BEGUN):
            env.reset(seed=seed)
            states.append(self._plant.state_of(env))
        env.close()
        return np.asarray((np.rint(states) == states).all(axis=0) & (np.ptp(states, axis=0) > 0))

    def _middles(self, pieces: Pieces, chosen: Booleans) -> Floats:
        """Return starts in the middles of the largest of some pieces, shape [N, d]."""
        low, high = pieces.low[chosen], pieces.high[chosen]
        order = np.argsort(-(high - low).sum(axis=1), kind="stable")
        low, high = low[order], high[order]
        return self._real(middle(low, high), low, high)[:_TRIES] if order.size else low

    def _real(self, points: Floats, low: Floats, high: Floats) -> Floats:
        """Return the points [N, d] in boxes at which real episodes may begin."""
        points = np.where(self._whole, np.rint(points), points)
        return points[((low <= points) & (points <= high)).all(axis=1)]

    def _broken_from(self, starts: Iterable[Floats]) -> dict[str, float] | None:
        """Return the first start from which Gymnasium breaks the property, and when."""
        for start in starts:
            if (steps := self._breaks(start)) is not None:
                return self._named(start, steps)
        return None

    def _breaks(self, start: Floats) -> int | None:
        """Return after how many steps a real episode has broken the property; None if it keeps."""
        path = replay(self._plant, self._policy, start, self._horizon)
        state = [Intervals.of(column) for column in path.states.T]
        if self._arriving:
            arrived = path.is_over and bool(self._plant.arrives(state).surely[-1])
            return None if arrived else len(path.states) - 1
        broken = np.flatnonzero(self._broken(state).surely)
        return int(broken[0]) if broken.size else None

    def _worst(self, pieces: Pieces) -> dict[str, float] | None:
        """Return a start that takes longest, and its steps when replayed; None if one may never."""
        starts = self._middles(pieces, np.arange(len(pieces.first)) == pieces.first.argmax())
        if (pieces.last == NEVER).any() or not len(starts):
            return None
        path = replay(self._plant, self._policy, starts[0], self._horizon)
        return self._named(starts[0], len(path.states) - 1)

    def _bounds(self, pieces: Pieces, shares: Floats) -> dict[str, tuple[float, float]]:
        bounds: dict[str, tuple[float, float]] = {}
        if (pieces.last != NEVER).all():
            bounds["steps"] = (int(pieces.first.min()), int(pieces.last.max()))
        limit, reward = self._plant.limit, self._plant.reward
        if reward is not None and limit == self._horizon and not self._whole.any():
            least, most = (
                float((shares * np.minimum(steps, limit)).sum()) + sign * _SUMMED * limit
                for steps, sign in ((pieces.shortest, -1), (pieces.last, 1))
            )
            low, high = sorted((reward * least, reward * most))
            bounds["mean_return"] = (low, high)
        return bounds

    def _named(self, start: Floats, steps: int) -> dict[str, float]:
        return {**dict(zip(self._plant.state, start.tolist(), strict=True)), "steps": steps}


def _inside(region: Region, state: Iterable[Intervals], size: tuple[int, ...]) -> Truth:
    """Return whether states are in a region, whose lower bounds are exclusive."""
    found = Truth(np.ones(size, dtype=bool), np.ones(size, dtype=bool))
    for one, low, high in zip(state, region.low.tolist(), region.high.tolist(), strict=True):
        if low != -np.inf:
            found = found & (one > low)
        if high != np.inf:
            found = found & (one <= high)
    return found


def _shares(pieces: Pieces, plant: Plant) -> Floats:
    """Return the share of all starts that each piece takes, shape [N]."""
    width = np.diff(plant.start)[:, 0]
    varies = width > 0
    sides = (pieces.high - pieces.low)[:, varies] / width[varies]
    shares: Floats = sides.prod(axis=1)
    return shares
