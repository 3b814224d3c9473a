"""Random trees and nasty names, for every test of an export."""

import hypothesis.strategies as st
import numpy as np

from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree

NASTY = (
    'a "quoted" name',
    "it's",
    "<script>alert(1)</script>",
    "line\nbreak\r\n\ttab",
    "*/ int x; /*",
    "*) END_IF; (*",
    "// ends in a backslash \\",
    "what??/",
    "--> ]]> &lt; &amp;",
    "position <= 3",
    "Größe, 速度, سرعة, 🙂",
    "\x00\x1b[31m\u202e\u2028\ufeff",
    "int",
    "INT",
    "class",
    "END_IF",
    "100%",
    "a_b",
    "a b",
    "a-b",
    "{curly} $math$ #hash ~^_",
    "`code` #quot; %%{init}%%",
    "",
    " ",
    "else",
    "x" * 200,
    "1st",
    '"""',
    "$(touch /tmp/x)",
    "end",
)


def tree(n_leaves: int, n_features: int, *, seed: int = 0) -> DecisionTree:
    rng = np.random.default_rng(seed)
    grown = DecisionTree.single_leaf(n_features)
    while grown.n_leaves < n_leaves:
        threshold = float(rng.normal() * 10.0 ** rng.integers(-3, 3))
        feature = int(rng.integers(n_features))
        grown = grown.split(int(rng.integers(grown.n_leaves)), feature, threshold)
    return grown


def chain(n_leaves: int, *, to_the_left: bool) -> DecisionTree:
    """Return the deepest tree with ``n_leaves`` leaves."""
    grown = DecisionTree.single_leaf(1)
    for number in range(n_leaves - 1):
        leaf = 0 if to_the_left else grown.n_leaves - 1
        grown = grown.split(leaf, 0, float(-number if to_the_left else number))
    return grown


def policy_of(
    grown: DecisionTree, schema: Schema | None = None, *, seed: int = 0, statistics: bool = False
) -> TreePolicy:
    rng = np.random.default_rng(seed)
    schema = schema or Schema.anonymous(grown.n_features, 3)
    shape = (grown.n_leaves, schema.n_actions)
    leaves = None
    if statistics:
        values = np.where(rng.random(shape) < 0.2, np.nan, rng.normal(size=shape))
        leaves = LeafStatistics(rng.integers(0, 1000, shape), values, np.abs(values) / 10)
    return TreePolicy(
        tree=grown,
        actions=rng.integers(0, schema.n_actions, grown.n_leaves),
        schema=schema,
        environment=EnvironmentSpec("eutree/Evasion2-v0"),
        leaves=leaves,
    )


EVASION = Schema(
    features=(
        Feature("position", "m", 0.0, 30.0),
        Feature("opponent_1", "m", -11.0, 11.0),
        Feature("opponent_2", "m", -11.0, 11.0),
    ),
    actions=("stop", "go"),
)

names = st.one_of(st.sampled_from(NASTY), st.text(max_size=12))
thresholds = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 1.7976931348623157e308, 0.1, 1e-40, 3.4e38]),
)


@st.composite
def policies(draw: st.DrawFn, *, max_leaves: int = 8) -> TreePolicy:
    """Draw a policy with any names, any finite thresholds and any shape."""
    features = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    units = [draw(st.sampled_from(["", "m", "m/s²", "°", *NASTY])) for _ in features]
    actions = draw(st.lists(names, min_size=1, max_size=3, unique=True))
    schema = Schema(
        tuple(Feature(name, unit) for name, unit in zip(features, units, strict=True)),
        tuple(actions),
    )
    grown = DecisionTree.single_leaf(len(features))
    for _ in range(draw(st.integers(0, max_leaves - 1))):
        leaf = draw(st.integers(0, grown.n_leaves - 1))
        feature = draw(st.integers(0, len(features) - 1))
        grown = grown.split(leaf, feature, draw(thresholds))
    seed = draw(st.integers(0, 1000))
    return policy_of(grown, schema, seed=seed, statistics=draw(st.booleans()))
