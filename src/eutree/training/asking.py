"""Confident Execution while learning: whom to ask, how often, and what became of it.

``docs/decisions/confident-execution.md`` says why it is made this way. All that is random or human
in a request is its answer. The answers are written to ``answers.jsonl`` of the run folder, step by
step; a run that goes on from a checkpoint comes to the same requests again and takes the answers
from there, so what a person showed is never asked for twice, and the run ends with the same bytes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from eutree.arrays import Floats
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import append_text, read_bytes, write_text
from eutree.interaction import GuardedEnv
from eutree.interaction.requests import (
    DECLINED,
    Controller,
    Request,
    StepAnswer,
    Stretch,
    controller_of,
)
from eutree.learners import Learner
from eutree.learners.confidence import Confidence
from eutree.learners.learner import CanDoubt
from eutree.policies import Policy
from eutree.validation import check_integer

ANSWERS = "answers.jsonl"
CONFIDENT, LONG_ENOUGH, EPISODE_OVER = "confident again", "long enough", "episode over"
STOPPED = "run stopped"
_MAX_ANSWERS = 64 * 2**20  # bytes


@dataclass(frozen=True, kw_only=True)
class Asking:
    """How often and how long somebody may be asked.

    Attributes:
        max_requests: Most requests of a run.
        max_steps: Most steps of one stretch; it ends before if the learner is sure again.
        max_per_episode: Most requests in one episode.
        alone: Episodes before the first request: while next to nothing has been tried, every
            situation is unsure, from the first step on, and asking would be recording.
        confidence: How unsure the learner must be.
    """

    max_requests: int = 20
    max_steps: int = 20
    max_per_episode: int = 1
    alone: int = 5
    confidence: Confidence = field(default_factory=Confidence)

    def __post_init__(self) -> None:
        check_integer("max_requests", self.max_requests, low=1)
        check_integer("max_steps", self.max_steps, low=1)
        check_integer("max_per_episode", self.max_per_episode, low=1)
        check_integer("alone", self.alone, low=0)


class Answer(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One step of an answer: the action at a step of an episode, or why there is none."""

    episode: int
    step: int
    action: int | None = None
    end: str = ""


class Answers:
    """What controllers have answered, on disk as soon as it is known.

    Args:
        path: The file; None keeps the answers in memory.

    Raises:
        FormatError: A line but the last is damaged.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path

    @cached_property
    def _known(self) -> dict[tuple[int, int], Answer]:
        """The answers by episode and step; read when first needed, in the locked run folder."""
        path = self._path
        if path is None or not path.exists():
            return {}
        lines = read_bytes(path, limit=_MAX_ANSWERS).split(b"\n")
        found = [_decoded(path, number, line) for number, line in enumerate(lines[:-1])]
        if lines[-1]:  # torn by the death of the process
            write_text(path, "".join(f"{_encoded(answer)}\n" for answer in found))
        return {(answer.episode, answer.step): answer for answer in found}

    def find(self, episode: int, step: int) -> Answer | None:
        """Return what was answered at this step, if it was asked before."""
        return self._known.get((episode, step))

    def add(self, answer: Answer) -> None:
        """Remember an answer; it survives the death of the process."""
        self._known[answer.episode, answer.step] = answer
        if self._path is not None:
            append_text(self._path, f"{_encoded(answer)}\n")


class Questions:
    """Asks a controller in one run.

    Args:
        controller: Whom to ask.
        asking: How often and how long.
        answers: What was answered before.
    """

    def __init__(self, controller: Controller, asking: Asking, answers: Answers) -> None:
        self._controller = controller
        self.asking = asking
        self._answers = answers

    def reason(
        self,
        learner: Learner,
        observation: Floats,
        *,
        episode: int,
        before: int,
        in_episode: int,
    ) -> str:
        """Return why to ask now, or "".

        Args:
            learner: The learner, within an episode.
            observation: The present one.
            episode: Number of the episode in the run, from 0.
            before: Requests of the run so far.
            in_episode: Requests of this episode so far.
        """
        asking = self.asking
        if before >= asking.max_requests or in_episode >= asking.max_per_episode:
            return ""
        if episode < asking.alone:
            return ""
        return _doubting(learner).doubt(observation, asking.confidence)

    def intended_action(self, learner: Learner, observation: Floats) -> int:
        """Return what the learner would take at an observation, were nobody asked."""
        return _doubting(learner).intended_action(observation)

    def ask(
        self,
        request: Request,
        observations: list[Floats],
        env: GuardedEnv,
        learner: Learner,
        step: Callable[[int], StepAnswer],
        stopped: Callable[[], bool],
    ) -> dict[str, Any]:
        """Let the controller act for a stretch; return what became of it.

        Args:
            request: What is asked.
            observations: Those of the episode so far; ``step`` adds to them.
            env: The environment as it stands.
            learner: Says whether it is sure again.
            step: Takes one step in the environment and lets the learner observe it.
            stopped: Whether the run was ended by a step.
        """
        ended = said = ""

        def take(action: int, count: int) -> tuple[StepAnswer, bool]:
            nonlocal ended
            place = len(observations) - 1
            if self._answers.find(request.episode, place) is None:
                self._answers.add(Answer(request.episode, place, action))
            answer = step(action)
            ended = STOPPED if stopped() else self._end(learner, answer, count)
            return answer, bool(ended)

        stretch = Stretch(env, take)
        while not (stretch.is_over or said):
            known = self._answers.find(request.episode, len(observations) - 1)
            if known is None:
                break
            if known.action is None:
                said = known.end
            else:
                stretch.step(known.action)
        if not (stretch.is_over or said):
            present = replace(
                request, step=len(observations) - 1, observations=np.array(observations)
            )
            said = self._controller.show(present, stretch)
            if not stretch.is_over:
                self._answers.add(Answer(request.episode, len(observations) - 1, end=said))
        return {
            "step": request.step,
            "reason": request.reason,
            "n_shown": stretch.n_steps,
            "outcome": ended or (said if stretch.n_steps else DECLINED),
        }

    def _end(self, learner: Learner, answer: StepAnswer, count: int) -> str:
        """Return why a stretch ends with this step, or ""."""
        observation, _, terminated, truncated, _ = answer
        if terminated or truncated:
            return EPISODE_OVER
        if count >= self.asking.max_steps:
            return LONG_ENOUGH
        return "" if _doubting(learner).doubt(observation, self.asking.confidence) else CONFIDENT


def _doubting(learner: Learner) -> CanDoubt:
    if not isinstance(learner, CanDoubt):
        raise InvalidArgumentError("ask must be None for a method that never doubts")
    return learner


def questions_for(
    ask: Policy | Controller | None, asking: Asking, out: str | Path | None
) -> Questions | None:
    """Return who asks in a run with the folder ``out``; None if nobody is to be asked."""
    if ask is None:
        return None
    answers = Answers(None if out is None else Path(out) / ANSWERS)
    return Questions(controller_of(ask), asking, answers)


def _encoded(answer: Answer) -> str:
    return msgspec.json.encode(answer).decode()


def _decoded(path: Path, number: int, line: bytes) -> Answer:
    try:
        return msgspec.json.decode(line, type=Answer)
    except (msgspec.MsgspecError, ValueError) as error:
        raise FormatError(path, f"line {number + 1}", str(error)) from None
