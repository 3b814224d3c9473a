"""In which order the tests run where several processes share them, and who compiles what.

xdist gives each process a part of the list, in order, and who is done takes from the others. From
an empty disk much of the time goes into compiling kernels, and two processes that met a kernel at
once both compiled it. So the first two parts begin with tests of different kernels, and who meets a
kernel that another is compiling waits and reads it from the disk.
"""

import functools
import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar

_Item = TypeVar("_Item")

# Each half of the kernels takes about as long to compile, and its tests call none of the other's.
APART = (
    ("c45", "splitting", "mdp", "trees"),
    ("world_model", "neural", "cart", "methods", "policy_search"),
)


def parted(
    items: Sequence[_Item], folder_of: Callable[[_Item], str], n_processes: int
) -> list[_Item]:
    """Return the items in an order in which the first two of equal parts compile different things.

    Args:
        items: The tests.
        folder_of: Returns the folder of tests, such as ``"c45"``, that an item lies in.
        n_processes: How many processes share them.
    """
    if n_processes < 2:
        return list(items)
    first, second = ([i for i in items if folder_of(i) in folders] for folders in APART)
    rest = [i for i in items if folder_of(i) not in {*APART[0], *APART[1]}]
    room = max(0, len(items) // n_processes - len(first))
    return [*first, *rest[:room], *second, *rest[room:]]


def compiling_alone(
    compiling: Callable[[Any, Any], Any], own_lock: AbstractContextManager[Any]
) -> Callable[[Any, Any], Any]:
    """Return numba's ``Dispatcher.compile`` behind a lock of each kernel, beside its cache.

    The compilation holds the locks of the kernels that the kernel calls, too. No circle of waiting
    comes of that: kernels do not call each other in a circle, and of the threads of a process one
    at most is here.

    Args:
        compiling: The method; it looks on the disk before it compiles.
        own_lock: Numba's, among the threads of a process.
    """

    @functools.wraps(compiling)
    def alone(dispatcher: Any, types: Any) -> Any:
        folder, kernel = dispatcher._cache.cache_path, dispatcher.py_func
        if folder is None or os.name == "nt":
            return compiling(dispatcher, types)
        import fcntl  # which is POSIX's

        place = Path(folder, f"{kernel.__module__}.{kernel.__qualname__}.lock")
        with own_lock, place.open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            return compiling(dispatcher, types)

    return alone
