"""Many independent calls at once: in processes of this machine, or on a Dask or Ray cluster.

joblib runs them, here by default; ``joblib.parallel_config(backend="dask")`` sends them elsewhere.
A call depends on its argument alone and results come back in order, so the bytes of everything made
from them are the same for any number of processes, on any machines of one type. Warnings of other
processes are given by this one, each once.
"""

import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from eutree.errors import InvalidArgumentError
from eutree.validation import check_integer

PATIENCE = 2.0  # s; starting processes that know eutree takes about as long
BLOCKS = 4  # a worker, so that one with long episodes does not keep the others waiting

_CLUSTERS = ("DaskDistributedBackend", "RayBackend")

Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """The processes that independent calls are spread over, as joblib counts them.

    -1 is as many as there are cores; None is 1, unless ``joblib.parallel_config`` says otherwise.
    """

    n_jobs: int | None = None

    def __post_init__(self) -> None:
        if self.n_jobs is None:
            return
        check_integer("n_jobs", self.n_jobs, low=-(2**20))
        if self.n_jobs == 0:
            raise InvalidArgumentError("n_jobs must be a number of processes or -1, got 0")

    @property
    def count(self) -> int:
        """How many there are."""
        if self.n_jobs == 1 or (self.n_jobs is None and "joblib" not in sys.modules):
            return 1  # without joblib nobody has chosen another number with it
        import joblib

        return int(joblib.effective_n_jobs(self.n_jobs))

    def map(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> list[Result]:
        """Return the results of ``function`` for all arguments, in their order.

        Processes of this machine are started only where ``PATIENCE`` seconds of work here were not
        enough; a cluster gets all of it. The function can be pickled, and its results depend on its
        argument alone.
        """
        if self.count == 1 or len(arguments) == 1:
            return [function(argument) for argument in arguments]
        begin = time.perf_counter()
        results: list[Result] = []
        if not _on_a_cluster():
            while len(results) < len(arguments) and time.perf_counter() - begin < PATIENCE:
                results.append(function(arguments[len(results)]))
        rest = arguments[len(results) :]
        return results + (list(self._answers(function, rest, "list")) if rest else [])

    def as_finished(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> Iterator[Result]:
        """Yield the results of ``function`` for the arguments as they come, in any order.

        Ray's back end hands everything back at the end.
        """
        from joblib.parallel import get_active_backend

        one_by_one = get_active_backend()[0].supports_return_generator
        return self._answers(function, arguments, "generator_unordered" if one_by_one else "list")

    def blocks(self, n: int, most: int) -> list[range]:
        """Return the numbers from 0 to n - 1 in blocks of at most ``most``, each for one call."""
        size = min(most, -(-n // (BLOCKS * self.count)))
        return [range(first, min(first + size, n)) for first in range(0, n, size)]

    def _answers(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument], ways: str
    ) -> Iterator[Result]:
        import joblib

        alone = _Alone(function)
        parallel = joblib.Parallel(n_jobs=self.n_jobs, return_as=ways)
        for answer in parallel(joblib.delayed(alone)(argument) for argument in arguments):
            yield _given(*answer)


_Warned = tuple[str, type[Warning], str, int]  # text, category, file and line

_heard: list[_Warned] = []  # in another process: since its last answer
_given_before: dict[Any, Any] = {}  # here: a registry of the module warnings


class _Surroundings:
    """Where this process finds modules, and that it gives the warnings of those that read this."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _settle, (list(sys.path), os.getpid())


def _settle(paths: list[str], caller: int) -> None:
    sys.path.extend(path for path in paths if path not in sys.path)
    if os.getpid() != caller:
        warnings.showwarning = _hear


def _hear(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: Any, **__: Any
) -> None:
    _heard.append((str(message), category, filename, lineno))


def _given(result: Result, heard: list[_Warned]) -> Result:
    """Return a result, once the warnings of its process are given here."""
    for warned in heard:
        warnings.warn_explicit(*warned, registry=_given_before)
    return result


class _Alone(Generic[Argument, Result]):
    """A function whose calls start no processes of their own: the workers have work already."""

    def __init__(self, function: Callable[[Argument], Result]) -> None:
        self._function = function

    def __getstate__(self) -> tuple[_Surroundings, Callable[[Argument], Result]]:
        """Return where modules are, then the function that may need them, for another process."""
        return _Surroundings(), self._function

    def __setstate__(self, state: tuple[None, Callable[[Argument], Result]]) -> None:
        self._function = state[1]

    def __call__(self, argument: Argument) -> tuple[Result, list[_Warned]]:
        import joblib

        with joblib.parallel_config(backend="sequential"):
            result = self._function(argument)
        heard = _heard.copy()
        _heard.clear()
        return result, heard


def _on_a_cluster() -> bool:
    """Return whether ``joblib.parallel_config`` sends calls to other machines."""
    from joblib.parallel import get_active_backend

    return type(get_active_backend()[0]).__name__ in _CLUSTERS
