"""Where a proof failed: boxes of states, from which episodes begin until the proof stands."""

from collections.abc import Sequence
from hashlib import sha256
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.interaction.spaces import spec_of
from eutree.proof.certificate import Certificate, Pieces, Starts
from eutree.proof.plant import Plant
from eutree.proof.plants import plant_of

MOST_BOXES = 1000  # that a certificate keeps, the largest
SHARE = 0.5  # of the episodes of learning that begin in them


def starts_among(pieces: Pieces, chosen: Booleans) -> Starts | None:
    """Return some pieces of the starts, neighbours along one number joined; None for none."""
    if not chosen.any():
        return None
    low, high = pieces.low[chosen], pieces.high[chosen]
    varies = np.flatnonzero((pieces.high > pieces.low).any(axis=0))
    if varies.size == 1:
        low, high = _joined(low, high, int(varies[0]))
    largest = np.argsort(-(high - low).sum(axis=1), kind="stable")[:MOST_BOXES]
    return Starts(pieces.names, low[largest], high[largest])


def digest_of(certificate: Certificate) -> str:
    """Return the SHA-256 of where episodes begin; empty for a certificate without starts."""
    starts = certificate.starts
    return (
        "" if starts is None else sha256(starts.low.tobytes() + starts.high.tobytes()).hexdigest()
    )


def _joined(low: Floats, high: Floats, along: int) -> tuple[Floats, Floats]:
    """Return boxes of which those that touch along a number are one."""
    order = np.argsort(low[:, along], kind="stable")
    low, high = low[order], high[order]
    begins = np.concatenate([[True], low[1:, along] > high[:-1, along]])
    ends = np.concatenate([begins[1:], [True]])
    return low[begins], high[ends]


class BeginningThere(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment whose episodes begin where certificates say that a proof failed.

    A certificate is drawn, then one of its boxes, all with equal chances, then a state in the box,
    uniformly; all of it follows from the seed of the reset.

    Args:
        env: The environment; a plant must be known for it, which puts it there.
        certificates: Certificates with starts, for example those of all rounds so far.
        share: Share of the episodes that begin there; the others begin as ever.

    Raises:
        InvalidArgumentError: A certificate has no starts, or they are no states of the environment.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        certificates: Sequence[Certificate],
        *,
        share: float = 1.0,
    ) -> None:
        super().__init__(env)
        self._plant = _plant_of(env)
        self._starts = [_starts_of(one, self._plant) for one in certificates]
        self._share = share
        self._generator = np.random.default_rng()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; return its first observation and what the environment says of it."""
        observation, info = self.env.reset(seed=seed, options=options)
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        if self._generator.random() >= self._share:
            return observation, info
        starts = self._starts[int(self._generator.integers(len(self._starts)))]
        point = starts.draw(self._generator)
        observation = self._plant.put(self.env, point)
        self.env.unwrapped.np_random = self._generator  # putting it there has used the same seed
        return observation, info


def _plant_of(env: gymnasium.Env[Any, Any]) -> Plant:
    spec = spec_of(env)
    plant = plant_of(spec)
    if plant is None:
        raise InvalidArgumentError(
            f"starts need a plant, which puts an environment there; none is known for {spec}"
        )
    return plant


def _starts_of(certificate: Certificate, plant: Plant) -> Starts:
    starts = certificate.starts
    if starts is None:
        raise InvalidArgumentError(
            "certificate must have boxes in which the proof fails or is undecided, got one without "
            f"any: {certificate}"
        )
    if plant.state != starts.names:
        raise InvalidArgumentError(
            f"certificate must be of {plant.environment}, whose state is "
            f"{', '.join(plant.state)}, got starts of {', '.join(starts.names)}"
        )
    return starts
