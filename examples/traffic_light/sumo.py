"""The traffic of SUMO, with the junctions that sumo-rl ships."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .light import Episode

if TYPE_CHECKING:
    from .simulation import Simulation


class Sumo:
    """Traffic that SUMO simulates, a second a step.

    libsumo has one simulation for a whole process, so an episode that begins ends the one before.
    """

    _under_way: "ClassVar[Simulation | None]" = None
    _own: "Simulation | None" = None

    def start(self, episode: Episode) -> dict[str, Any]:
        """Begin; return the plan's signals and amber, and the counts of the lanes."""
        from .simulation import Simulation  # SUMO is needed here first

        if Sumo._under_way is not None:
            Sumo._under_way.finish()
        self._own = Sumo._under_way = Simulation(
            options_of(episode, network(episode.junction.name)),
            episode.junction.light,
            episode.junction.all_lanes,
            actuated=episode.program == "actuated",
        )
        return self._own.program() | self._own.counts()

    def show(self, shown: list[tuple[str | None, int]]) -> dict[str, Any]:
        """Show signals, or the programme's own, each for so many seconds; return what came of it.

        That is ``standing``, the vehicle seconds of standing, and the counts of the lanes after it.
        """
        simulation = self._mine()
        return simulation.show(shown) | simulation.counts()

    def finish(self) -> dict[str, float]:
        """End the episode; return its delay and its longest wait."""
        simulation = self._mine()
        Sumo._under_way = self._own = None
        return simulation.finish()

    def stop(self) -> None:
        """End wherever the episode is."""
        if self._own is not None and self._own is Sumo._under_way:
            self.finish()

    def _mine(self) -> "Simulation":
        if self._own is None or self._own is not Sumo._under_way:
            raise RuntimeError("reset comes first; SUMO plays one episode at a time in a process")
        return self._own


def options_of(episode: Episode, folder: Path) -> list[str]:
    """Return the command line of SUMO for an episode of the junction in a folder."""
    name = episode.junction.name
    pairs = {
        "-n": folder / f"{name}.net.xml",
        "-r": folder / f"{name}.rou.xml",
        "-b": episode.junction.begin,
        "--seed": episode.seed,
        "--scale": episode.demand,
        "--time-to-teleport": -1,
    }
    flags = ["--no-warnings", "--no-step-log", "--tripinfo-output.write-unfinished",
             "--tripinfo-output.write-undeparted"]  # fmt: skip
    return [str(word) for pair in pairs.items() for word in pair] + flags


def network(name: str) -> Path:
    """Return the folder of a junction in sumo-rl, which is not imported: it wants SUMO_HOME."""
    spec = find_spec("sumo_rl")
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError("sumo-rl is not installed; see examples/traffic_light/README.md")
    return Path(spec.origin).parent / "nets" / "RESCO" / name
