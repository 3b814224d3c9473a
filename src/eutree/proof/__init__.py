"""Proofs about trajectories: whether a policy arrives, stays or succeeds, from every start."""

from eutree.proof._kernels import ActingNodes
from eutree.proof.certificate import (
    Certificate,
    Picture,
    Pieces,
    Starts,
    load_certificate,
    save_certificate,
)
from eutree.proof.intervals import Intervals, Truth, clip, cos, maximum, minimum, sin, sqrt, where
from eutree.proof.plant import Plant, plant_of, register_plant
from eutree.proof.prove import NeedsEpisodesError, prove
from eutree.proof.reach import Effort
from eutree.proof.replay import BeginningThere, Trajectory, check_plant, replay

__all__ = [
    "ActingNodes", "BeginningThere", "Certificate", "Effort", "Intervals", "NeedsEpisodesError",
    "Picture", "Pieces", "Plant", "Starts", "Trajectory", "Truth", "check_plant", "clip", "cos",
    "load_certificate", "maximum", "minimum", "plant_of", "prove", "register_plant", "replay",
    "save_certificate", "sin", "sqrt", "where",
]  # fmt: skip
