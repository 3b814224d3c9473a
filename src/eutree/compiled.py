"""The one place that imports numba: ``@compiled`` turns a plain loop into machine code.

Kernels live in files named ``_kernels.py``. Compiled code is cached on disk, uses no fast-math
(it would change the order of sums and the meaning of NaN) and no threads. With ``EUTREE_JIT=0``
in the environment the same functions run as plain Python, slowly but with equal results.
"""

import os
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
                self.flush()
                return None


def compiled(function: _Function) -> _Function:
    """Compile ``function`` with numba (cached on disk); return it unchanged if EUTREE_JIT=0."""
    if not ENABLED:
        return function
    dispatcher = numba.njit(cache=True)(function)
    dispatcher._cache = _Cache(function)
    kernel: _Function = dispatcher
    return kernel
