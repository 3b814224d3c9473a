"""Proofs about trajectories: whether a policy arrives, stays or succeeds, from every start."""

from eutree.proof.certificate import Certificate, Pieces
from eutree.proof.intervals import Intervals, Truth, clip, cos, maximum, minimum, sin, sqrt, where
from eutree.proof.plant import Plant
from eutree.proof.plants import plant_of, register_plant
from eutree.proof.prove import prove
from eutree.proof.reach import Effort
from eutree.proof.replay import Trajectory, check_plant, replay

__all__ = [
    "Certificate",
    "Effort",
    "Intervals",
    "Pieces",
    "Plant",
    "Trajectory",
    "Truth",
    "check_plant",
    "clip",
    "cos",
    "maximum",
    "minimum",
    "plant_of",
    "prove",
    "register_plant",
    "replay",
    "sin",
    "sqrt",
    "where",
]
