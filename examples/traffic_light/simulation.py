"""An episode in libsumo, which has one simulation for a whole process."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import libsumo


class Simulation:
    """An episode under way.

    Args:
        options: The command line of SUMO.
        light: Id of the light.
        lanes: The lanes to be counted.
        actuated: Whether the light prolongs its phases by itself, by detectors in the lanes.
    """

    def __init__(
        self, options: Sequence[str], light: str, lanes: Sequence[str], *, actuated: bool = False
    ) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._trips = Path(self._folder.name, "trips.xml")
        command = ["sumo", *options, "--tripinfo-output", str(self._trips)]
        libsumo.start(command)
        if actuated:
            program = Path(self._folder.name, "actuated.add.xml")
            write_actuated(program, light)
            libsumo.close()
            libsumo.start([*command, "-a", str(program)])
        self._light, self._lanes, self._longest = light, lanes, 0.0
        self._edges = [edge for edge in libsumo.edge.getIDList() if not edge.startswith(":")]

    def program(self) -> dict[str, Any]:
        """Return the signals of each green phase of the plan, and its amber in seconds."""
        phases = libsumo.trafficlight.getAllProgramLogics(self._light)[0].phases
        return {
            "signals": [phase.state for phase in phases if "y" not in phase.state],
            "amber": round(next(phase.duration for phase in phases if "y" in phase.state)),
        }

    def show(self, shown: Sequence[tuple[str | None, int]]) -> dict[str, float]:
        """Show signals, or the programme's own, each for a while; return the vehicle seconds."""
        standing = 0.0
        for signals, seconds in shown:
            if signals is not None:
                libsumo.trafficlight.setRedYellowGreenState(self._light, signals)
            for _ in range(seconds):
                libsumo.simulationStep()
                standing += sum(map(libsumo.edge.getLastStepHaltingNumber, self._edges))
                standing += len(libsumo.simulation.getPendingVehicles())
        waits = map(libsumo.vehicle.getWaitingTime, libsumo.vehicle.getIDList())
        self._longest = max([self._longest, *waits])
        return {"standing": standing}

    def counts(self) -> dict[str, list[int]]:
        """Return the vehicles that stand in each lane, and those that drive there."""
        waiting = [libsumo.lane.getLastStepHaltingNumber(lane) for lane in self._lanes]
        there = [libsumo.lane.getLastStepVehicleNumber(lane) for lane in self._lanes]
        return {"waiting": waiting, "coming": [a - b for a, b in zip(there, waiting, strict=True)]}

    def finish(self) -> dict[str, float]:
        """Return RESCO's delay (seconds a vehicle) and the longest wait (seconds)."""
        libsumo.close()
        return {"delay": mean_delay(self._trips), "longest_wait": self._longest}


def mean_delay(trips: Path) -> float:
    """Return the mean of the time that vehicles lost on the way and before they could enter.

    That is RESCO's measure (utils/readXML.py: timeLoss and departDelay), for all vehicles that were
    to depart, whether they have arrived or not.
    """
    lost = [
        float(trip.attrib["departDelay"]) + max(float(trip.attrib["timeLoss"]), 0.0)
        for trip in ElementTree.parse(trips).getroot()
    ]
    return sum(lost) / max(len(lost), 1)


def write_actuated(path: Path, light: str) -> None:
    """Write the plan's phases as a programme that detectors prolong, of 5 to 50 s each."""
    root = ElementTree.Element("additional")
    program = ElementTree.SubElement(
        root, "tlLogic", id=light, type="actuated", programID="actuated", offset="0"
    )
    for phase in libsumo.trafficlight.getAllProgramLogics(light)[0].phases:
        limits = {} if "y" in phase.state else {"minDur": "5", "maxDur": "50"}
        ElementTree.SubElement(
            program, "phase", duration=str(phase.duration), state=phase.state, **limits
        )
    ElementTree.ElementTree(root).write(path)
