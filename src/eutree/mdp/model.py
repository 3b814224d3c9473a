"""The model of an MDP over leaves: Pr and R as arrays that a solver reads.

With T(s, a) the transitions that left leaf s by action a (Eqs. 3 and 4 of the paper):

    Pr(s, a, s') = |{(o, a, r, o') in T(s, a) : L(o') = s'}| / |T(s, a)|          (Eq. 3)
    R(s, a)      = (sum of r over T(s, a)) / |T(s, a)|, the mean immediate reward  (Eq. 4)

A terminated transition leads to no leaf: what is missing in a row of Pr to 1 is the probability
that the episode terminates, after which the value is 0. A truncated one is no such transition: it
leads to the leaf of its last observation.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Int32s, Integers, frozen
from eutree.errors import InvalidArgumentError

TERMINAL = -1
"""The next state of a terminated transition."""

NO_ACTION = -1
"""The action of a state in which nothing was tried."""


@dataclass(frozen=True, eq=False)
class Model:
    """Pr and R of an MDP, sparse, with pair p = s A + a.

    Attributes:
        indptr: Where the successors of each pair begin and end in the next two arrays.
        successor: Successors of each pair, ascending; TERMINAL is not among them.
        probability: Pr(s, a, successor) (Eq. 3); positive.
        termination: Probability that the episode terminates.
        reward: R(s, a) (Eq. 4); 0 where the action was never tried.
        visits: How often the action was tried; 0 means that nothing is known of the pair.
    """

    indptr: Integers  # [S A + 1]
    successor: Int32s  # [K]
    probability: Floats  # [K]
    termination: Floats  # [S, A]
    reward: Floats  # [S, A]
    visits: Integers  # [S, A]

    def __post_init__(self) -> None:
        dtypes = {"indptr": np.int64, "successor": np.int32, "visits": np.int64}
        for name in ("indptr", "successor", "probability", "termination", "reward", "visits"):
            array = np.asarray(getattr(self, name), dtype=dtypes.get(name, np.float64))
            object.__setattr__(self, name, frozen(array))
        if self.visits.ndim != 2 or not self.visits.size:
            raise InvalidArgumentError(
                f"visits must have shape (S, A) with S, A >= 1, got {self.visits.shape}"
            )
        if message := _fault(self):
            raise InvalidArgumentError(message)

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return int(self.visits.shape[0])

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        return int(self.visits.shape[1])

    @property
    def n_triples(self) -> int:
        """Number of distinct triples (s, a, s') with s' not terminal."""
        return int(self.successor.size)

    def dense(self) -> Floats:
        """Return Pr as an array [S, A, S]; its rows sum to 1 minus the termination."""
        shape = (self.n_states, self.n_actions, self.n_states)
        probabilities = np.zeros((shape[0] * shape[1], shape[2]))
        pair = np.repeat(np.arange(len(probabilities)), np.diff(self.indptr))
        probabilities[pair, self.successor] = self.probability
        return probabilities.reshape(shape)


def _fault(model: Model) -> str:
    """Return what is wrong with the arrays of a model; empty if nothing is."""
    shape = model.visits.shape
    if model.reward.shape != shape or model.termination.shape != shape:
        return (
            f"reward and termination must have the shape {shape} of visits, "
            f"got {model.reward.shape} and {model.termination.shape}"
        )
    if model.indptr.shape != (model.visits.size + 1,) or (np.diff(model.indptr) < 0).any():
        return f"indptr must have {model.visits.size + 1} entries that never fall"
    sizes = {model.successor.shape, model.probability.shape}
    if sizes != {(int(model.indptr[-1]),)} or model.indptr[0] != 0:
        return "successor and probability must have as many entries as indptr says"
    if model.successor.size and not (
        0 <= model.successor.min() <= model.successor.max() < model.n_states
    ):
        return f"successor must be in 0..{model.n_states - 1}"
    if not np.isfinite(model.reward).all():
        return "reward must be finite"
    starts = np.concatenate([[0.0], np.cumsum(model.probability)])[model.indptr]
    mass = np.diff(starts).reshape(shape) + model.termination
    wrong = (model.visits > 0) & ~(np.abs(mass - 1.0) <= 1e-6)
    if wrong.any():
        s, a = np.argwhere(wrong)[0]
        return f"probabilities must sum to 1, got {mass[s, a]:g} for state {s}, action {a}"
    return ""
