"""The one place that imports numba: ``@compiled`` turns a plain loop into machine code.

Kernels live in files named ``_kernels.py``. Compiled code is cached on disk, uses no fast-math
(it would change the order of sums and the meaning of NaN) and no threads. With ``EUTREE_JIT=0``
in the environment the same functions run as plain Python, slowly but with equal results.
"""

import os
from collections.abc import Callable
from typing import TypeVar

_Function = TypeVar("_Function", bound=Callable[..., object])

ENABLED = os.environ.get("EUTREE_JIT", "1") != "0"

if ENABLED:
    import numba


def compiled(function: _Function) -> _Function:
    """Compile ``function`` with numba (cached on disk); return it unchanged if EUTREE_JIT=0."""
    if not ENABLED:
        return function
    kernel: _Function = numba.njit(cache=True)(function)
    return kernel
