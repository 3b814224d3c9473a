"""The presets: the default, and what the paper states, in its two readings, and its correction."""

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import cast

from eutree.learners.learner import Method

_HOMES = MappingProxyType({
    "default": "eutree.learners.planning:DEFAULT",
    "paper": "eutree.learners.u_tree:PAPER",
    "paper-d": "eutree.learners.u_tree:PAPER_D",
    "corrected": "eutree.learners.u_tree:CORRECTED",
})  # fmt: skip


class Presets(Mapping[str, Method]):
    """The presets by name; the method of each is imported when it is asked for."""

    def __getitem__(self, name: str) -> Method:
        return cast(Method, EntryPoint(name, _HOMES[name], "").load())

    def __iter__(self) -> Iterator[str]:
        return iter(_HOMES)

    def __len__(self) -> int:
        return len(_HOMES)


PRESETS = Presets()


def reads_the_paper(method: Method) -> bool:
    """Return whether a method splits by the paper's stopping criterion, read literally.

    What such a learner ends with is what is studied, so nothing takes its place.
    """
    return bool(getattr(method, "reads_the_paper", False))
