"""A strategy of formulas of derived features."""

from hypothesis import strategies as st


def formulas_of(*parts, most=12):
    """Return a strategy of formulas of at most so many parts, in brackets."""
    return st.recursive(st.sampled_from(parts), _bracketed, max_leaves=most)


def _bracketed(parts):
    """Return a strategy of formulas with brackets around every part."""
    pairs = st.tuples(parts, parts)
    tests = st.tuples(parts, st.sampled_from(["<", "<=", ">", ">="]), parts).map(" ".join)
    conditions = st.tuples(tests, st.sampled_from(["and", "or"]), tests, st.booleans()).map(
        lambda one: " ".join(one[:3]) if one[3] else one[0]
    )
    return st.one_of(
        st.tuples(pairs, st.sampled_from("+-*/")).map(
            lambda one: f"({one[0][0]} {one[1]} {one[0][1]})"
        ),
        pairs.map(lambda one: f"min({one[0]}, {one[1]})"),
        parts.map(lambda one: f"(-{one})"),
        parts.map(lambda one: f"abs({one})"),
        st.tuples(pairs, conditions).map(lambda one: f"({one[0][0]} if {one[1]} else {one[0][1]})"),
    )
