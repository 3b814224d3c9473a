"""In which order the tests run where several processes share them.

xdist gives each process a part of the list, in order, and who is done takes from the others. From
an empty disk much of the time goes into compiling kernels, and two processes that meet a kernel at
once both compile it. So the first two parts begin with tests of different kernels.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

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
