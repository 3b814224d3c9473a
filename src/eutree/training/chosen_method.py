"""The method of a run: the one that was named or chosen, with what the run asks of any method."""

from dataclasses import replace
from typing import Any, cast

from eutree.errors import InvalidArgumentError
from eutree.learners import Method
from eutree.learners import method as method_of
from eutree.learners.default_choice import Choice, Evidence, default_for, say
from eutree.learners.registry import checked_method
from eutree.validation import check_integer


def choice_of(
    method: str | Method | None,
    start: str | None,
    evidence: Evidence,
    *,
    offline: bool,
    plans: bool,
) -> Choice:
    """Return the method that is meant, and why where nobody said so; that is said aloud, too.

    With ``plans`` something is asked of the run that only planning does.
    """
    if method is not None:
        own = method_of(method) if isinstance(method, str) else checked_method(method)
        return Choice(own, "")
    if offline or plans or start not in (None, "demos", "tree+demos"):
        return Choice(method_of("corrected" if offline else "default"), "")
    choice = default_for(evidence)
    if choice.alternative:
        say(choice.said())
    return choice


def with_limit(method: Method, max_leaves: int | None, *, races: bool) -> Method:
    """Return a method that ends with at most so many leaves, unless a race sees to that.

    Where one does, a planner knows no limit: what its explorers may try decides what is stored, and
    from that the race's models are fitted (``docs/decisions/racing.md``).
    """
    if max_leaves is None:
        return method
    check_integer("max_leaves", max_leaves, low=2)
    if hasattr(method, "max_leaves"):
        return cast(Method, replace(cast(Any, method), max_leaves=max_leaves))
    if races:
        return method
    planner = getattr(method, "planner", None)
    if planner is None:
        raise InvalidArgumentError(
            f"max_leaves must be None for method {method.name!r} without race_steps, "
            f"got {max_leaves}"
        )
    improvement = replace(planner.improvement, max_leaves=max_leaves)
    limited = replace(planner, improvement=improvement)
    return cast(Method, replace(cast(Any, method), planner=limited))


def remembering(chosen: Method, max_transitions: int | None) -> Method:
    """Return a method with the bound on its memory."""
    if max_transitions is None:
        return chosen
    if not hasattr(chosen, "max_transitions"):
        raise InvalidArgumentError(
            f"max_transitions must be None for method {chosen.name!r}, got {max_transitions}"
        )
    return cast(Method, replace(cast(Any, chosen), max_transitions=max_transitions))
