"""What the search chooses from: the values of every choice, and the ways from one to another."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np

from eutree_lab.paper.settings import (
    GATE,
    LABEL,
    LOOK_AHEAD,
    SPLITS,
    ZERO,
    Demonstrator,
    Domain,
    Reading,
    Setting,
)

DOMAINS: Mapping[str, tuple[Any, ...]] = {
    "time_step": (0.5, 1.0, 1.5, 2.0, 3.0),
    "collision_distance": (1.0, 1.5, 2.0, 2.5, 3.0),
    "noise": (0.01, 0.02, 0.05, 0.1),
    "start": ("anywhere", "either end", "same end"),
    "bounce": ("reflect", "turn"),
}
DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {"wait_distance": (5.5, 6.5, 7.5, 8.5, 9.5, 10.5)}
READINGS: Mapping[str, tuple[Any, ...]] = {
    "untried": (LABEL, ZERO),
    "split": tuple(SPLITS),
    "compare": ("pooled", "action"),
    "min_leaf": (1, 5, 10),
    "gathering_episodes": (10, 20, 40),
    "exploration": (0.05, 0.1, 0.2),
    "discount": (0.9, 0.99, 1.0),
}
FINER: Mapping[str, tuple[Any, ...]] = {
    **DOMAINS,
    "time_step": (0.5, 0.6, 0.75, 0.9, 1.0, 1.25, 1.5),
    "collision_distance": (0.75, 1.0, 1.25, 1.5, 1.75, 2.0),
    "noise": (0.01, 0.02, 0.03, 0.05, 0.07, 0.1),
}
FINER_DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {
    "wait_distance": (6.5, 7.5, 8.5, 9.0, 9.5, 10.0, 10.5)
}
WIDER: Mapping[str, tuple[Any, ...]] = {
    "time_step": (0.5, 0.6, 0.75, 0.9, 1.0),
    "collision_distance": (1.0, 1.25, 1.5, 1.75, 2.0, 2.5),
    "noise": (0.01, 0.02, 0.03, 0.05),
    "start": ("anywhere", "either end", "same end"),
    "bounce": ("reflect", "turn"),
    "spacing": (0.85, 1.0, 1.1),
    "shift": (-2.0, -1.0, 0.0, 1.0, 2.0),
}
WIDER_DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {
    "rule": (GATE, LOOK_AHEAD),
    "wait_distance": (8.0, 8.5, 9.0, 9.5, 10.0),
    "margin": (0.75, 1.0, 1.5, 2.0, 2.5, 3.0),
}
BETWEEN: Mapping[str, tuple[Any, ...]] = {
    "time_step": (0.4, 0.5, 0.6, 0.75, 0.9, 1.0),
    "collision_distance": (1.0, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0),
    "noise": (0.005, 0.01, 0.015, 0.02, 0.03, 0.05),
    "start": ("anywhere", "either end", "same end"),
    "bounce": ("reflect", "turn"),
}
BETWEEN_DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {
    "rule": (GATE, LOOK_AHEAD),
    "wait_distance": (7.5, 8.0, 8.5, 9.0, 9.5, 10.0, 10.5, 11.0),
    "margin": (0.75, 1.0, 1.5, 2.0, 2.5),
}
Spaces = Mapping[str, Mapping[str, tuple[Any, ...]]]
COARSE: Spaces = {"domain": DOMAINS, "demonstrator": DEMONSTRATORS, "reading": READINGS}
FINE: Spaces = {"domain": FINER, "demonstrator": FINER_DEMONSTRATORS, "reading": READINGS}
WIDE: Spaces = {"domain": WIDER, "demonstrator": WIDER_DEMONSTRATORS}
NARROW: Spaces = {"domain": BETWEEN, "demonstrator": BETWEEN_DEMONSTRATORS}
# What the nearest setting is changed in, one at a time.
DEPARTURES: tuple[tuple[str, str, Any], ...] = (
    ("domain", "agent_speed", 1.5),
    ("domain", "agent_speed", 2.5),
    ("domain", "spacing", 0.85),
    ("domain", "shift", 2.0),
    ("reading", "gathering_episodes", 5),
    ("reading", "gathering_episodes", 80),
)
# From the first domain and reading to those of the preset ``paper``, one change after the other.
_FIRST = Setting(reading=Reading(untried=ZERO, exploration=0.1))
_LABELS = replace(_FIRST, reading=Reading(exploration=0.1))
_ENDS = replace(_LABELS, domain=replace(_LABELS.domain, start="either end"))
_NEARER = replace(_ENDS, domain=replace(_ENDS.domain, collision_distance=1.0))
_NOISIER = replace(_NEARER, domain=replace(_NEARER.domain, noise=0.05))
_LATER = replace(_NOISIER, demonstrator=Demonstrator(wait_distance=9.5))
_BOLDER = replace(_LATER, reading=Reading(exploration=0.05))
STEPS = (_FIRST, _LABELS, _ENDS, _NEARER, _NOISIER, _LATER, _BOLDER)


def mutated(setting: Setting, generator: np.random.Generator, spaces: Spaces = COARSE) -> Setting:
    """Return the setting with one choice changed to another of its values."""
    parts = dict(spaces)
    if setting.demonstrator.folder:
        del parts["domain"], parts["demonstrator"]
    if setting.reading is None:
        parts.pop("reading", None)
    choices = [(part, name) for part, space in parts.items() for name in space]
    if LOOK_AHEAD in parts.get("demonstrator", {}).get("rule", ()):
        idle = "wait_distance" if setting.demonstrator.rule == LOOK_AHEAD else "margin"
        choices.remove(("demonstrator", idle))
    part, name = choices[int(generator.integers(len(choices)))]
    before = getattr(getattr(setting, part), name)
    others = [value for value in parts[part][name] if value != before]
    return with_choice(setting, part, name, _draw(generator, others))


def with_choice(setting: Setting, part: str, name: str, value: Any) -> Setting:
    """Return the setting with a choice; what then counts nothing is as if nobody had chosen it."""
    changed: Any = replace(getattr(setting, part), **{name: value})
    if name == "rule":
        default = Demonstrator()
        idle = "wait_distance" if value == LOOK_AHEAD else "margin"
        changed = replace(changed, **{idle: getattr(default, idle)})
    return replace(setting, **{part: changed})


def drawn(generator: np.random.Generator, spaces: Spaces) -> Setting:
    """Return a domain and a demonstrator at random."""
    domain = Domain(**{name: _draw(generator, of) for name, of in spaces["domain"].items()})
    chosen = {name: _draw(generator, of) for name, of in spaces["demonstrator"].items()}
    found = Setting(domain=domain, demonstrator=Demonstrator(**chosen))
    return with_choice(found, "demonstrator", "rule", found.demonstrator.rule)


def choices_of(setting: Setting) -> dict[str, Any]:
    """Return the choices of a setting by name; those of the reading are missing without one."""
    found = asdict(setting.domain) | asdict(setting.demonstrator)
    return found | (asdict(setting.reading) if setting.reading is not None else {})


CHOICES = tuple(f.name for part in (Domain, Demonstrator, Reading) for f in fields(part))


def _draw(generator: np.random.Generator, values: Sequence[Any]) -> Any:
    return values[int(generator.integers(len(values)))]
