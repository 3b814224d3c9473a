"""A learner from a file: its state is compared with what the method declares, and then restored."""

from pathlib import Path

from eutree.errors import EutreeError, FormatError
from eutree.learners.declared import Arrays, State, taken
from eutree.learners.learner import Learner, Method, Problem, Start


def checked_state(
    path: str | Path, state: State, method: Method, problem: Problem, start: Start
) -> Arrays:
    """Return a stored state that ``restore`` can trust, with the elements that are declared.

    Args:
        path: The file that it comes from.
        state: Its arrays.
        method: The method that declares them.
        problem: What is learned.
        start: Where it began.

    Raises:
        FormatError: The state is not what the method declares.
    """
    return taken(path, state, method.declared(problem, start))


def restored(
    path: str | Path, state: State, method: Method, problem: Problem, start: Start
) -> Learner:
    """Return the learner of a stored state.

    Raises:
        FormatError: The state is not what the method declares, or no learner comes of it.
    """
    trusted = checked_state(path, state, method, problem, start)
    try:
        return method.restore(problem, start, trusted)
    except FormatError:
        raise
    except (EutreeError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise FormatError(path, "state", f"no learner comes of it: {error}") from error
