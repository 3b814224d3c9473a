"""Makes the trees of a person of a study, and keeps what each one reached."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from eutree.fitting.page_tree import PageTree
from eutree.fitting.study_export import FITTED, PRACTISED, TAKEN_OVER, TreeResult, result_of

if TYPE_CHECKING:
    from eutree.recording.scenes import Programme, Scene
    from eutree.recording.tree_making import Show, TreeView


class StudyTree:
    """Makes the tree of a person of a study; a ``TreeMaker``.

    It shows neither commands nor a choice, and keeps each tree with what it reached.

    Args:
        tree: Makes it.
        folder: Where the trees are kept.
        watched: Most episodes to watch.
    """

    def __init__(self, tree: PageTree, folder: Path, watched: int) -> None:
        self._tree, self._folder, self._watched = tree, folder, watched
        self.results: list[TreeResult] = []
        self.failed = False

    @property
    def names(self) -> list[str]:
        """Which trees there are."""
        return [result.tree for result in self.results]

    def make(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Make the tree of what was shown, or of that and what was put right."""
        name = TAKEN_OVER if FITTED in self.names else FITTED
        watched = self._watched if name == FITTED else -1
        self._keep(name, lambda: self._tree.make(_plainly(show, watched), stop))

    def practise(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Let the tree learn by itself."""
        self._keep(PRACTISED, lambda: self._tree.practise(_plainly(show, -1), stop))

    def missing(self) -> "Scene | None":
        """Return None: each person is told the same."""
        return None

    def choose(self, way: int, show: "Show") -> None:
        """Do nothing: there is no choice."""

    def _keep(self, name: str, work: Callable[[], None]) -> None:
        try:
            work()
        finally:
            best = self._tree.best
            self.failed = best is None
        if best is not None:
            tree, played = best
            tree.save(self._folder / f"{name}.json")
            self.results.append(result_of(name, tree, played))


def _plainly(show: "Show", watched: int) -> "Show":
    """Return a ``Show`` without commands and choices, and with at most so many episodes.

    Args:
        show: Shows it.
        watched: Most episodes to watch; below 0 nothing drives any more.
    """

    def plain(view: "TreeView", programme: "Programme | None" = None) -> None:
        if programme is not None:
            programme = replace(programme, scenes=programme.scenes[:watched])
        view = replace(view, commands=(), ways=(), changes=(), note="", may_gain=False)
        show(view, programme if watched >= 0 else None)

    return plain
