"""The one place that imports numba: ``@compiled`` turns a plain loop into machine code.

Kernels live in files named ``_kernels.py``. Compiled code is cached on disk, uses no fast-math
(it would change the order of sums and the meaning of NaN) and no threads. Where no folder for the
cache can be written, as in a container with everything read-only, each process compiles again.

Compiling takes a second for each of a hundred kernels, and the first command after an installation
waits for it. So a kernel that is marked by ``compiled_later`` runs as plain Python, with equal
results, until it has taken about as long as compiling it would. ``EUTREE_JIT=0`` in the environment
compiles nothing at all, ``EUTREE_JIT=1`` every kernel at its first call. The logger
``eutree.compiled`` names each kernel that is being compiled.
"""

import logging
import os
import time
import warnings
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

import numpy as np

_Function = TypeVar("_Function", bound=Callable[..., object])

ENABLED = os.environ.get("EUTREE_JIT") != "0"
AT_ONCE = os.environ.get("EUTREE_JIT") == "1"
PATIENCE = 1.0  # s of the processor for plain Python, before a kernel is compiled
LARGE = 20_000  # elements of all arguments from which on plain Python is not even tried

logger = logging.getLogger(__name__)

if ENABLED:
    import numba
    from numba.core import caching

    class _Cache(caching.FunctionCache):  # type: ignore[misc]  # numba has no types
        """Numba's cache on disk, without its failure on the files of another version.

        The index of a kernel's cache names the classes of its arguments. Numba reads it before it
        looks whether the index is out of date, so a class that has been renamed stops the call.
        """

        def __init__(self, function: Callable[..., object]) -> None:
            super().__init__(function)
            self._kernel = f"{function.__module__}.{function.__qualname__}"

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            """Return the compiled code, or None where there is none that can be used."""
            found = None
            try:
                found = super().load_overload(sig, target_context)
            except _OF_ANOTHER_VERSION:
                try:
                    self.flush()
                except OSError as error:
                    self._do_without(error)
            if found is None:
                logger.info("compiling %s", self._kernel)
            return found

        @property
        def is_empty(self) -> bool:
            """Whether nothing is kept of this kernel, for any types."""
            try:
                return not self._cache_file._load_index()
            except (*_OF_ANOTHER_VERSION, OSError):
                return True

        def save_overload(self, sig: Any, data: Any) -> None:
            """Keep the compiled code; without room for it on the disk it is merely not kept."""
            try:
                super().save_overload(sig, data)
            except OSError as error:
                self._do_without(error)

        def _do_without(self, error: OSError) -> None:
            self.disable()
            _say_that_nothing_is_kept(f"{self.cache_path}: {error.strerror or error}")

    # A RuntimeError is LLVM's. Numba writes the index before the code, so between the two another
    # process may find the code that an older LLVM or a newer one has left there.
    _OF_ANOTHER_VERSION = (
        AttributeError, ImportError, EOFError, RuntimeError, caching.pickle.UnpicklingError
    )  # fmt: skip

    _plain_worlds: dict[str, dict[str, Any]] = {}  # globals of modules, kernels as plain Python

    def _plain_world(own: dict[str, Any]) -> dict[str, Any]:
        name = own["__name__"]
        if name not in _plain_worlds:
            _plain_worlds[name] = world = dict(own)
            world |= {key: _plain(value) for key, value in own.items() if _is_kernel(value)}
        return _plain_worlds[name]

    def _plain(dispatcher: Any) -> Callable[..., Any]:
        """Return a kernel as plain Python that calls other kernels as plain Python too."""
        function = dispatcher.py_func
        world = _plain_world(function.__globals__)
        return FunctionType(
            function.__code__, world, function.__name__, function.__defaults__, function.__closure__
        )

    def _is_kernel(value: object) -> bool:
        return isinstance(value, numba.core.dispatcher.Dispatcher)

    class _FirstCalls:
        """The calls of a kernel with types that it is not compiled for.

        Numba asks for something to call, and calls that.
        """

        def __init__(self, dispatcher: Any) -> None:
            self._dispatcher = dispatcher
            self._compiled = dispatcher._compile_for_args
            self._taken = 0.0  # s
            self._nothing_kept: bool | None = None
            self._plain: Callable[..., Any] | None = None

        def __call__(self, *arguments: Any, **named: Any) -> Any:
            """Return the function to be called: machine code, or plain Python."""
            waits = self._taken < PATIENCE and not AT_ONCE
            if waits and _elements(arguments) < LARGE and self._is_cold():
                return self._interpreted
            return self._compiled(*arguments, **named)

        def _is_cold(self) -> bool:
            """Return whether nothing was compiled, neither here nor in the cache at first sight."""
            if self._nothing_kept is None:
                cache = self._dispatcher._cache
                self._nothing_kept = not isinstance(cache, _Cache) or cache.is_empty
            return self._nothing_kept and not self._dispatcher.overloads

        def _interpreted(self, *arguments: Any, **named: Any) -> Any:
            begin = time.thread_time()
            if self._plain is None:
                self._plain = _plain(self._dispatcher)
            try:
                with np.errstate(all="ignore"):  # machine code warns of nothing
                    return self._plain(*arguments, **named)
            finally:
                self._taken += time.thread_time() - begin

    class _OneWidth:
        """The types of a kernel when another calls it: integers have 64 bits.

        Numba would compile it once more for each literal and each width of an integer argument,
        and compiling is most of the wait of a first run. The caller casts, which loses nothing.
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


def _elements(arguments: tuple[Any, ...]) -> int:
    """Return the number of elements of all arrays among arguments and in named tuples of them."""
    return sum(
        _elements(one) if isinstance(one, tuple) else getattr(one, "size", 1) for one in arguments
    )


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


def compiled_later(function: _Function) -> _Function:
    """Compile ``function`` once it has taken a while as plain Python, or its arguments are large.

    It is for kernels whose work grows with the size of their arguments, so that a call with little
    takes little.
    """
    return _compiled(function, counts=True, later=True)


def compiled_uncounted(function: _Function) -> _Function:
    """Compile a function that only kernels call and that makes no array and returns no view of one.

    Numba counts who holds each array: two atomic additions for each of the dozens in a few named
    tuples, whenever one of them is taken apart. Here it does not: the kernel that calls holds all
    of them until the call returns.
    """
    return _compiled(function, counts=False)


def inlined(function: _Function) -> _Function:
    """Put a part of a kernel into the kernel that calls it.

    A call hands over seven numbers for each array of a named tuple, which takes longer than a
    short loop. Each use is compiled again, so it is for the few parts of which that is true.
    """
    if not ENABLED:
        return function
    part: _Function = numba.njit(function, inline="always")
    return part


def _compiled(function: _Function, *, counts: bool, later: bool = False) -> _Function:
    if not ENABLED:
        return function
    # Nothing calls kernels through C.
    dispatcher = numba.njit(function, no_cfunc_wrapper=True, _nrt=counts)
    dispatcher.get_call_template = _OneWidth(dispatcher.get_call_template)
    if later:
        dispatcher._compile_for_args = _FirstCalls(dispatcher)
    try:
        dispatcher._cache = _Cache(function)  # as njit(cache=True) does, with our cache
    except RuntimeError:  # neither the package's folder nor the user's can be written
        _say_that_nothing_is_kept("neither the package's folder nor the home can be written")
    kernel: _Function = dispatcher
    return kernel


@compiled
def overwrite(target: Any, source: Any) -> None:
    """Fill an array from another; numba takes seconds to compile ``target[:] = source``."""
    for i in range(target.size):
        target[i] = source[i]


def machine_code(kernel: _Function, *arguments: object) -> _Function:
    """Return the machine code of a kernel for arguments of these types, without the search for it.

    A call of a kernel looks at the type of each argument to find the machine code; for a named
    tuple of a dozen arrays that takes longer than the work of a learner's step. The function
    returned does not look: a caller answers for the types, dtypes and dimensions of the
    arguments and for the order of arrays, which must be those of ``arguments``.
    """
    if not ENABLED:
        return kernel
    code: _Function = kernel.compile(  # type: ignore[attr-defined]  # numba has no types
        tuple(numba.typeof(argument) for argument in arguments)
    )
    return code
