"""A folder of results: one file a run, so an interruption loses at most the runs under way."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from eutree.files import Document, make_folder, read_document, write_document
from eutree.files.atomic import RESULTS, remove_orphans
from eutree.parallel import Workers
from eutree_lab.paper.runs import RunRecord, RunSpec, run


class _Spec(Protocol):
    """The data that a run is made from, and its name."""

    @property
    def name(self) -> str: ...


Spec = TypeVar("Spec", bound=_Spec)
Record = TypeVar("Record", bound=Document)


class RecordFolder(Generic[Spec, Record]):
    """The runs that are done, on disk: a document for each.

    Args:
        folder: Where; made if it does not exist.
        record_type: Type of the documents.
        run: Does a run, in a process of its own, and returns a record for ``keep``.
    """

    def __init__(
        self, folder: str | Path, record_type: type[Record], run: Callable[[Spec], Any]
    ) -> None:
        self.folder = make_folder(folder, of=RESULTS)
        self._type = record_type
        self._run = run
        self._runs = make_folder(self.folder / "runs")
        remove_orphans(self._runs)

    def has(self, spec: Spec) -> bool:
        """Return whether the run is done."""
        return self._path(spec).exists()

    def load(self, specs: Iterable[Spec]) -> list[Record]:
        """Return the records of runs that are done, in this order."""
        return [read_document(self._path(spec), self._type) for spec in specs]

    def keep(self, outcome: Any) -> Spec:
        """Write the record of a run, whole or not at all; return its spec."""
        spec: Spec = outcome.spec
        write_document(self._path(spec), outcome)
        return spec

    def complete(
        self,
        specs: Sequence[Spec],
        *,
        n_jobs: int | None = None,
        on_run: Callable[[int, Spec], None] = lambda count, spec: None,
    ) -> None:
        """Do the runs that are missing, and save each as soon as it is done.

        Args:
            specs: All runs that are wanted.
            n_jobs: Processes, as ``evaluate`` takes them.
            on_run: Called after each run with how many are done and the run's spec.
        """
        missing = [spec for spec in dict.fromkeys(specs) if not self.has(spec)]
        before = len(set(specs)) - len(missing)
        finished = Workers(n_jobs).as_finished(self._run, missing)
        for count, outcome in enumerate(finished, before + 1):
            on_run(count, self.keep(outcome))

    def _path(self, spec: Spec) -> Path:
        return self._runs / f"{spec.name}.json"


class Results(RecordFolder[RunSpec, RunRecord]):
    """The runs of the paper's experiments that are done, on disk.

    Args:
        folder: Where; made if it does not exist.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, RunRecord, run)
