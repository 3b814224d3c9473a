"""Many independent calls at once: in processes of this machine, or on a Dask or Ray cluster.

joblib runs them, here by default; ``joblib.parallel_config(backend="dask")`` sends them elsewhere.
What is called depends on its argument alone and results come back in order, so the bytes of what
is made from them are the same for any number of processes, on any machines of one type.
"""

import sys
import time
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
    """What many independent calls are spread over.

    Args:
        n_jobs: Processes, as joblib counts them: -1 for as many as there are cores. None is 1,
            unless ``joblib.parallel_config`` says otherwise.
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
        """Return what ``function`` returns for each argument, in their order.

        Processes of this machine are started only where ``PATIENCE`` seconds of work here were not
        enough; a cluster gets all of it.

        Args:
            function: Can be pickled, and its results depend on its argument alone.
            arguments: Of independent calls.
        """
        if self.count == 1 or len(arguments) == 1:
            return [function(argument) for argument in arguments]
        begin = time.perf_counter()
        results: list[Result] = []
        if not _on_a_cluster():
            while len(results) < len(arguments) and time.perf_counter() - begin < PATIENCE:
                results.append(function(arguments[len(results)]))
        rest = arguments[len(results) :]
        return results + (self._parallel(function, rest) if rest else [])

    def as_finished(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> Iterator[Result]:
        """Yield what ``function`` returns for the arguments as it is done, in any order.

        Ray's back end hands everything back at the end.
        """
        import joblib
        from joblib.parallel import get_active_backend

        alone = _Alone(function)
        one_by_one = get_active_backend()[0].supports_return_generator
        ways = "generator_unordered" if one_by_one else "list"
        parallel = joblib.Parallel(n_jobs=self.n_jobs, return_as=ways)
        yield from parallel(joblib.delayed(alone)(argument) for argument in arguments)

    def blocks(self, n: int, most: int) -> list[range]:
        """Return the numbers from 0 to n - 1 in blocks, each the work of one call.

        Args:
            n: How many there are.
            most: Largest size of a block.
        """
        size = min(most, -(-n // (BLOCKS * self.count)))
        return [range(first, min(first + size, n)) for first in range(0, n, size)]

    def _parallel(
        self, function: Callable[[Argument], Result], arguments: Sequence[Argument]
    ) -> list[Result]:
        import joblib

        alone = _Alone(function)
        parallel = joblib.Parallel(n_jobs=self.n_jobs)
        results: list[Result] = parallel(joblib.delayed(alone)(argument) for argument in arguments)
        return results


class _Paths:
    """Where this process finds modules; another one looks there too once it has read this."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _look_in, (list(sys.path),)


def _look_in(paths: list[str]) -> None:
    sys.path.extend(path for path in paths if path not in sys.path)


class _Alone(Generic[Argument, Result]):
    """A function whose calls start no processes of their own: the workers have work already."""

    def __init__(self, function: Callable[[Argument], Result]) -> None:
        self._function = function

    def __getstate__(self) -> tuple[_Paths, Callable[[Argument], Result]]:
        """Return what another process reads: where modules are, before what may need them."""
        return _Paths(), self._function

    def __setstate__(self, state: tuple[None, Callable[[Argument], Result]]) -> None:
        self._function = state[1]

    def __call__(self, argument: Argument) -> Result:
        import joblib

        with joblib.parallel_config(backend="sequential"):
            return self._function(argument)


def _on_a_cluster() -> bool:
    """Return whether ``joblib.parallel_config`` sends calls to other machines."""
    from joblib.parallel import get_active_backend

    return type(get_active_backend()[0]).__name__ in _CLUSTERS
