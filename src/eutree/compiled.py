"""The one place that imports numba: ``@compiled`` turns a plain loop into machine code.

Kernels live in files named ``_kernels.py``. Compiled code is cached on disk, uses no fast-math
(it would change the order of sums and the meaning of NaN) and no threads. Where no folder for the
cache can be written, as in a container with everything read-only, each process compiles anew. With
``EUTREE_JIT=0`` in the environment the same functions run as plain Python, slowly but with equal
results.
"""

import os
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., object])

ENABLED = os.environ.get("EUTREE_JIT", "1") != "0"

if ENABLED:
    import numba
    from numba.core import caching

    class _Cache(caching.FunctionCache):  # type: ignore[misc]  # numba has no types
        """Numba's cache on disk, without its failure on what another version left behind.

        The index of a kernel's cache names the classes of its arguments. Numba reads it before it
        looks whether the index is out of date, so a class that has been renamed stops the call.
        """

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            """Return the compiled code, or None where there is none that can be used."""
            try:
                return super().load_overload(sig, target_context)
            except (AttributeError, ImportError, EOFError, caching.pickle.UnpicklingError):
                try:
                    self.flush()
                except OSError as error:
                    self._do_without(error)
                return None

        def save_overload(self, sig: Any, data: Any) -> None:
            """Keep the compiled code; without room for it on the disk it is merely not kept."""
            try:
                super().save_overload(sig, data)
            except OSError as error:
                self._do_without(error)

        def _do_without(self, error: OSError) -> None:
            self.disable()
            _say_that_nothing_is_kept(f"{self.cache_path}: {error.strerror or error}")

    class _OneWidth:
        """What a kernel is compiled for when another calls it: integers of 64 bits.

        Numba would compile it once more for each literal and each width of an integer argument,
        and compiling is most of what a first run waits for. The caller casts, which loses nothing.
        """

        def __init__(self, template: Callable[..., Any]) -> None:
            self._template = template

        def __call__(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
            """Return the template of a call with the arguments widened."""
            return self._template(
                tuple(map(self._wide, args)), {name: self._wide(kind) for name, kind in kws.items()}
            )

        @staticmethod
        def _wide(kind: Any) -> Any:
            is_integer = isinstance(kind, numba.types.IntegerLiteral) or (
                isinstance(kind, numba.types.Integer) and kind.signed
            )
            return numba.types.int64 if is_integer else kind


_said = False


def _say_that_nothing_is_kept(reason: str) -> None:
    """Warn, once in a process, that its next run will have to compile again."""
    global _said
    if not _said:
        _said = True
        warnings.warn(
            f"compiled code cannot be kept ({reason}), so every process compiles again, which "
            "takes seconds; set NUMBA_CACHE_DIR to a folder that can be written (said once)",
            stacklevel=4,
        )


def compiled(function: _Function) -> _Function:
    """Compile ``function`` with numba (cached on disk); return it unchanged if EUTREE_JIT=0."""
    return _compiled(function, counts=True)


def compiled_uncounted(function: _Function) -> _Function:
    """Compile what only kernels call, and what makes no array and no view of one.

    Numba counts who holds each array: two atomic additions for each of the dozens in a few named
    tuples, whenever one of them is taken apart. Here it does not: the kernel that calls holds all
    of them until the call returns.
    """
    return _compiled(function, counts=False)


def inlined(function: _Function) -> _Function:
    """Put a part of a kernel into the kernel that calls it.

    A call hands over seven numbers for each array of a named tuple, which takes longer than a
    short loop. Each use is compiled anew, so it is for the few parts of which that is true.
    """
    part: _Function = numba.njit(function, inline="always") if ENABLED else function
    return part


def _compiled(function: _Function, *, counts: bool) -> _Function:
    if not ENABLED:
        return function
    # Nothing calls kernels through C.
    dispatcher = numba.njit(function, no_cfunc_wrapper=True, _nrt=counts)
    dispatcher.get_call_template = _OneWidth(dispatcher.get_call_template)
    try:
        dispatcher._cache = _Cache(function)  # what njit(cache=True) does, with our cache
    except RuntimeError:  # neither the package's folder nor the user's can be written
        _say_that_nothing_is_kept("neither the package's folder nor the home can be written")
    kernel: _Function = dispatcher
    return kernel


def machine_code(kernel: _Function, *arguments: object) -> _Function:
    """Return what a kernel runs for arguments of these types, without the search for it.

    A call of a kernel looks at the type of each argument to find the machine code; for a named
    tuple of a dozen arrays that takes longer than the work of a learner's step. The function
    returned does not look: whoever calls it answers for the types, dtypes and dimensions of the
    arguments and for the order of arrays, which must be those of ``arguments``.

    Args:
        kernel: A function from ``compiled``; returned as it is if EUTREE_JIT=0.
        arguments: An example of each argument.
    """
    if not ENABLED:
        return kernel
    code: _Function = kernel.compile(  # type: ignore[attr-defined]  # numba has no types
        tuple(numba.typeof(argument) for argument in arguments)
    )
    return code
