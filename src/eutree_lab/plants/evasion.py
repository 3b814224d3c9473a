"""The plant of N-Evasion: success rates and returns of a policy, over all chance."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from eutree.envs.evasion import EvasionParameters
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.proof import Certificate, Picture, Plant
from eutree.proof.certificate import CELLS, KNOWN, PROOF, PROVEN, REFUTED, UNDECIDED
from eutree.proof.properties import EpisodeProperty
from eutree.schema import EnvironmentSpec
from eutree_lab.plants.evasion_chain import SUCCESS, EvasionChain, Payoffs

_CELLS, _SPACING = 880, 0.4  # of an opponent's circle; of the agent's places
_BEST_CELLS, _BEST_SPACING = 440, 0.5
_COARSER = (1, 2, 4, 8)  # where several opponents are carried at once, until they fit
_MOST_NOISE = 0.15  # more, and a forward step of 0 is likelier than the tails left out of account


class Evasion(Plant):
    """Opponents that cross the agent's path, each on its own; ``eutree/envs/_dynamics.py``."""

    by_chance = True
    question = "succeeds"

    def __init__(self, spec: EnvironmentSpec) -> None:
        self.environment = spec
        env = self.make()
        self._parameters: EvasionParameters = env.unwrapped.parameters  # type: ignore[attr-defined]  # it is an EvasionEnv
        self.state = tuple(env.unwrapped.feature_names)  # type: ignore[attr-defined]  # same
        low, high = env.unwrapped.return_range  # type: ignore[attr-defined]  # same
        limit = env.spec.max_episode_steps if env.spec else None
        env.close()
        p = self._parameters
        if limit is not None and limit < p.max_steps:  # Gymnasium is the first to cut it
            p = self._parameters = replace(p, trial_limit=limit * p.time_step)
        _check(spec, "start", p.start, "anywhere")
        _check(spec, "bounce", p.bounce, "reflect")
        if not (0.0 < p.noise <= _MOST_NOISE and p.opponent_speed > 0):
            raise InvalidArgumentError(
                f"the plant of {spec.id} needs noise above 0 and up to {_MOST_NOISE}, and "
                f"opponents that move, got noise={p.noise} and opponent_speed={p.opponent_speed}"
            )
        self.start = ((0.0, 0.0), *((-p.half_path, p.half_path),) * p.n_opponents)
        self._rewards = Payoffs(
            goal=p.goal_reward,
            collision=p.collision_reward,
            late=0.0,
            stop=p.stop_reward,
            low=low,
            high=high,
        )

    def certify(
        self, policy: TreePolicy, asked: EpisodeProperty, refinements: Sequence[int]
    ) -> Certificate:
        """Return bounds of the success or of the mean return, over all starts and all noise."""
        if asked.kind not in ("succeeds", "returns") or (
            asked.kind == "returns" and asked.chance is not None
        ):
            raise InvalidArgumentError(
                f"property {asked.text!r} cannot be proven in {self.environment}, whose noise has "
                "no bounds; ask 'succeeds with probability at least P' or 'returns at least R'"
            )
        name, payoffs, least = "success", SUCCESS, asked.chance
        if asked.kind == "returns":
            name, payoffs, least = "mean_return", self._rewards, asked.least
        bounds, chain = self._bounds(policy, payoffs, least, refinements)
        best = self._best(payoffs)
        if least is None:  # that it succeeds less often than always is no praise
            verdict = UNDECIDED if bounds[0] == payoffs.low else PROVEN
        else:
            open_or_refuted = REFUTED if bounds[1] < least else UNDECIDED
            verdict = PROVEN if bounds[0] >= least else open_or_refuted
        return Certificate(
            sentence=self._sentence(asked, verdict, bounds, best),
            kind=PROOF,
            verdict=verdict,
            bounds={name: bounds, f"best_{name}": (bounds[0], best)},
            undecided=1.0 if verdict == UNDECIDED else 0.0,
            pictures=tuple(self._pictures(chain, name.replace("_", " "))),
            work={"cells": chain.n_cells, "steps": self._parameters.max_steps},
        )

    def _bounds(
        self, policy: TreePolicy, payoffs: Payoffs, least: float | None, refinements: Sequence[int]
    ) -> tuple[tuple[float, float], EvasionChain]:
        """Return bounds of the policy and the finest chain; finer ones until they decide."""
        low, high, used = payoffs.low, payoffs.high, None
        for refine in refinements:
            chain = self._chain(policy, refine)
            if used is not None and chain.n_cells <= used.n_cells:
                break  # as fine as it may be
            found, used = chain.bounds(payoffs), chain
            low, high = max(low, found[0]), min(high, found[1])
            if least is not None and not low < least <= high:
                break
        assert used is not None  # noqa: S101 - there is a refinement
        return (low, high), used

    def _pictures(self, chain: EvasionChain, what: str) -> Iterator[Picture]:
        """Yield the bounds for an agent that has not stopped yet, a picture for each opponent."""
        p = self._parameters
        half = p.path_length / 2
        for i in range(p.n_opponents):
            least = chain.least_by_place(i)
            parts = np.array_split(least, min(CELLS, least.shape[1]), axis=1)
            values = np.stack([part.mean(axis=1) for part in parts], axis=1)
            yield Picture(
                title=f"{what.capitalize()} at least, from where {self.state[1 + i]} is",
                names=(self.state[0], self.state[1 + i]),
                low=(0.0, -half),
                high=(len(values) * p.agent_step, half),
                values=values,
                marks=np.full(values.shape, KNOWN),
                legend=f"The agent has not stopped yet. Light: {values.min():.4g}; dark: "
                f"{values.max():.4g}.",
            )

    def _chain(self, policy: TreePolicy, refine: int) -> EvasionChain:
        """Return the finest chain that fits."""
        for coarser in _COARSER:
            cells, spacing = _CELLS * refine // coarser, _SPACING * coarser / refine
            try:
                return EvasionChain(self._parameters, policy, cells=cells, spacing=spacing)
            except InvalidArgumentError as error:
                failure = error
        raise failure

    def _best(self, payoffs: Payoffs) -> float:
        """Return an upper bound of all policies' returns; with one opponent there is no lower one.

        An episode that another opponent would have ended by a collision goes on instead, and
        going to the goal without a stop is worth at least a collision.
        """
        p = self._parameters
        if payoffs.collision > min(payoffs.goal, payoffs.late):
            return payoffs.high
        found = [payoffs.high]
        for crossing in p.crossing.tolist():
            alone = replace(p, n_opponents=1, crossings=(crossing,), observe_direction=False)
            chain = EvasionChain(alone, None, cells=_BEST_CELLS, spacing=_BEST_SPACING)
            found.append(chain.bounds(payoffs)[1])
        return min(found)

    def _sentence(
        self, asked: EpisodeProperty, verdict: str, bounds: tuple[float, float], best: float
    ) -> str:
        over = f"over all starts and all noise of {self.environment}"
        what = "its success" if asked.kind == "succeeds" else "its mean return"
        found = (
            f"{what} is in [{bounds[0]:.4g}, {bounds[1]:.4g}], that of no policy above {best:.4g}"
        )
        if asked.chance is None and asked.least is None:
            below = "from below " * (bounds[1] < best)
            nothing = f"; {below}this says nothing of the policy" * (verdict == UNDECIDED)
            return f"{over} {found}{nothing}"
        said = {
            PROVEN: f"it {asked.text}",
            REFUTED: f"it is not true that it {asked.text}",
            UNDECIDED: f"whether it {asked.text} is open",
        }
        return f"{over} {said[verdict]}: {found}"


def _check(spec: EnvironmentSpec, name: str, value: str, known: str) -> None:
    if value != known:
        raise InvalidArgumentError(
            f"the plant of {spec.id} knows {name}={known!r}, got {value!r}; a statistical "
            "certificate needs no plant (--sampled)"
        )
