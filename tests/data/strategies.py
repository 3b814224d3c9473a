"""Hypothesis strategies for episodes and demonstrations."""

import numpy as np
from hypothesis import strategies as st

from eutree.data import Demonstrations, Episode
from eutree.schema import EnvironmentSpec
from tests.policies.strategies import ids, json_values, names, schemas


@st.composite
def episodes(draw, n_features=2, n_actions=2):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    length = draw(st.integers(0, 8))
    steps = {}
    if draw(st.booleans()):
        steps = {
            "time": rng.random(length),
            "frame": rng.integers(0, 99, length),
            "keys": rng.random((length, 3)) < 0.5,
        }
    ended = draw(st.sampled_from([(False, False), (True, False), (False, True)]))
    return Episode(
        rng.standard_cauchy((length + 1, n_features)) * 10.0 ** rng.integers(-300, 300),
        rng.integers(0, n_actions, length),
        rng.choice([0.0, -0.0, 5e-324, -2.0, 100.0, 0.1], length),
        *ended,
        seed=draw(st.none() | st.integers(0, 2**128)),
        ending=draw(names),
        is_success=draw(st.none() | st.booleans()),
        kept=draw(st.booleans()),
        comment=draw(names),
        steps=steps,
        extras=draw(st.dictionaries(names, json_values, max_size=2)),
    )


@st.composite
def demonstrations(draw):
    schema = draw(schemas())
    return Demonstrations(
        tuple(draw(st.lists(episodes(schema.n_features, schema.n_actions), max_size=3))),
        schema,
        draw(st.none() | st.builds(EnvironmentSpec, ids, st.just({"speed": 2.5}))),
        draw(names),
    )


def same(left, right):
    """Whether two demonstrations are equal, bit for bit."""
    return (
        len(left.episodes) == len(right.episodes)
        and all(a.equals(b) for a, b in zip(left.episodes, right.episodes, strict=True))
        and left.schema == right.schema
        and left.environment == right.environment
        and left.expert == right.expert
    )


def three_episodes(environment=None):
    """A fixed value: two kept episodes and a discarded one, with all kinds of extras."""
    from eutree.schema import Feature, Schema

    schema = Schema((Feature("position", "m", 0.0, 30.0), Feature("speed")), ("stop", "go"))
    made = []
    for number, length in enumerate((3, 5, 2)):
        k = np.arange(length)
        made.append(
            Episode(
                np.arange(2.0 * length + 2).reshape(-1, 2) / 7 + number,
                (k + number) % 2,
                np.where(k == length - 1, 100.0, -0.1 * k),
                terminated=number != 1,
                truncated=number == 1,
                seed=number,
                ending=("goal", "time limit", "collision")[number],
                is_success=number == 0,
                kept=number != 2,
                comment="" if number else "a good one",
                steps={"time": k / 8, "keys": np.stack([k % 2 == 0, k % 3 == 0], axis=1)},
                extras={"keys": ["space", "right"]},
            )
        )
    return Demonstrations(tuple(made), schema, environment, "someone")
