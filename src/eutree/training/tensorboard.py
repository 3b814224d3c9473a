"""The progress of a run for TensorBoard; needs the extra ``tensorboard``."""

import time
from pathlib import Path
from typing import Any

from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.files import make_folder
from eutree.training.progress import values_of
from eutree.training.run import Run


class TensorBoardLog:
    """Writes what happens in a run to a folder that TensorBoard shows.

    A resumed run hides what the interrupted one wrote after its last checkpoint, and writes it
    again.

    Args:
        path: The folder; one for each run, so that TensorBoard tells them apart.
        run: The run, where it begins or goes on.

    Raises:
        InvalidArgumentError: The folder holds the log of another run.
        MissingExtraError: tensorboardX is not installed.
    """

    def __init__(self, path: str | Path, run: Run) -> None:
        try:
            from tensorboardX import SummaryWriter
        except ImportError:
            raise MissingExtraError("tensorboardX", "tensorboard") from None
        folder = make_folder(path)
        earlier = len(list(folder.glob("events.out.tfevents.*")))
        if not run.state.events and earlier:
            raise InvalidArgumentError(
                f"tensorboard must be a folder without the log of another run, got {folder}"
            )
        self._run = run
        self._start = time.monotonic()
        self._steps_before = run.state.num_timesteps
        # What the folder holds of this step and later ones does not count any more.
        self._first_step = run.state.num_timesteps if run.plan.gathers else run.at.updates
        self._n_events = self._iterations = 0
        self._writer: Any = SummaryWriter(
            str(folder),
            purge_step=self._first_step,
            filename_suffix=f".{earlier}",  # its names have whole seconds
        )
        self.write()

    def write(self) -> None:
        """Write what happened since the last call."""
        for event in self._run.state.events[self._n_events :]:
            self._iterations += event["event"] == "expansion"
            step = event["steps"] if self._run.plan.gathers else self._iterations
            if step >= self._first_step:
                values = values_of(event, self._run.gathered)
                if event["event"] == "expansion":
                    values |= self._times()
                for name, value in values.items():
                    if value is not None:
                        self._writer.add_scalar(name, value, step)
        self._n_events = len(self._run.state.events)

    def close(self) -> None:
        """Write what is left, and end the log."""
        self._writer.close()

    def _times(self) -> dict[str, float | int | None]:
        elapsed = max(time.monotonic() - self._start, 1e-9)
        steps = self._run.state.num_timesteps - self._steps_before
        return {
            "time/episodes": self._run.episode,
            "time/fps": steps / elapsed,
            "time/time_elapsed": elapsed,
        }
