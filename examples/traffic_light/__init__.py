"""Two lights of RESCO (Ault and Sharon 2021): ``Cologne1-v0`` and ``Ingolstadt1-v0``."""

from typing import Any

import gymnasium

from .controllers import FixedCycle, longest_queue, max_pressure, max_wave
from .light import Junction, TrafficLight
from .sumo import Sumo

__all__ = ["FixedCycle", "TrafficLight", "longest_queue", "max_pressure", "max_wave"]

COLOGNE = Junction(
    "cologne1",
    "GS_cluster_357187_359543",
    7 * 3600,
    ("north-south", "north-south left", "east-west", "east-west left"),
    (
        ("27115123#3_0", "27115123#3_1", "23429231#1_0", "23429231#1_1"),
        ("27115123#3_1", "23429231#1_1"),
        ("-32038056#3_0", "-32038056#3_1", "28198821#3_0", "28198821#3_1"),
        ("-32038056#3_1", "28198821#3_1"),
    ),
)
INGOLSTADT = Junction(
    "ingolstadt1",
    "gneJ207",
    16 * 3600,
    ("north-south", "south alone", "west"),
    (
        ("104010354_1", "104010354_2", "201963537#1_1", "201963537#1_2"),
        ("201963537#1_1", "201963537#1_2", "201963537#1_3"),
        ("164051413_1", "164051413_2"),
    ),
)


# No arm is red for more than a minute and a half, whatever is learned; amber comes on top.
RULES = {
    "Cologne1-v0": (
        "always north-south when red for north-south >= 90",
        "always east-west when red for east-west >= 90 and red for north-south < 90",
    ),
    "Ingolstadt1-v0": (
        "always north-south when red for north-south >= 90",
        "always west when red for west >= 90 and red for north-south < 90",
    ),
}

# What a tree cannot ask for in a single test: how many vehicles more there are for one than for
# another. The numbers are computed by whatever the tree is exported to.
_ALL = '"waiting for {0}" + "coming for {0}"'
DERIVED = {
    "Cologne1-v0": (
        f"more for east-west = {_ALL.format('east-west')} - ({_ALL.format('north-south')})",
    ),
    "Ingolstadt1-v0": (
        f"more for west = {_ALL.format('west')} - ({_ALL.format('north-south')})",
        f"more for south = {_ALL.format('south alone')} - ({_ALL.format('north-south')})",
    ),
}


def cologne(**options: Any) -> TrafficLight:
    """Return the light of Cologne, from seven in the morning on."""
    return TrafficLight(COLOGNE, Sumo(), **options)


def ingolstadt(**options: Any) -> TrafficLight:
    """Return the light of Ingolstadt, from four in the afternoon on."""
    return TrafficLight(INGOLSTADT, Sumo(), **options)


gymnasium.register("Cologne1-v0", cologne)
gymnasium.register("Ingolstadt1-v0", ingolstadt)
