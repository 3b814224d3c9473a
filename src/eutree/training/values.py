"""The values by which a run is asked for, and the plain words that stand for their parts.

``learn(env, budget=Budget(episodes=400), folder=Folder("runs/a"))`` and ``learn(env, episodes=400,
out="runs/a")`` ask for the same: each word builds the value that it is a part of.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypedDict

from eutree.errors import InvalidArgumentError, UnknownNameError, shown
from eutree.interaction.acting import Controller
from eutree.training.handover import Handover
from eutree.training.listeners import (
    CallbackLike,
    Callbacks,
    Listener,
    Progress,
    StopWhen,
    TensorBoard,
)
from eutree.training.run import Run
from eutree.training.run_folder import started
from eutree.training.teaching import Teacher
from eutree.validation import check_amounts, check_kind, check_measures

if TYPE_CHECKING:
    from eutree.proof import Certificate


@dataclass(frozen=True, kw_only=True)
class Budget:
    """How long a run may be; where several limits are named, the first that is reached ends it.

    Attributes:
        episodes: Most episodes of experience; offline, the most updates. 400 where no other limit
            is named, else as many as that allows.
        steps: Most environment steps of the run: those of learning and of racing, without
            demonstrations and evaluations. An episode begins only if the longest possible one
            still fits; where none is known, one is cut short at the limit.
        minutes: Most minutes of the clock for all of it: learning, racing and evaluation, for which
            a fifth is kept at the end. The learned tree then depends on the machine; all else
            repeats byte for byte.
        race_steps: Environment steps spent at the end on policy search with racing: trees proposed
            by several world models, prunings and random changes prove themselves against the
            policy in episodes with common starts. They are part of ``steps``.
    """

    episodes: int | None = None
    steps: int | None = None
    minutes: float | None = None
    race_steps: int = 0

    def __post_init__(self) -> None:
        check_amounts(self, episodes=0, steps=1, race_steps=0)
        check_measures(self, "minutes", low=0.0, low_open=True)

    @property
    def is_open(self) -> bool:
        """Whether no limit is named."""
        return self.episodes is self.steps is self.minutes is None


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """When the policy is frozen and evaluated, on the same episodes each time.

    Attributes:
        every: Episodes between two evaluations. None for 20; where episodes run one by one and the
            run is shorter than 400, only the first and the last policy are evaluated.
        episodes: Episodes of each evaluation. None for 100; where episodes run one by one and the
            run is shorter than 400, all that is played beside it, at its end too, is about half of
            its episodes up to 40, 125 at 100, 500 at 200.
    """

    every: int | None = None
    episodes: int | None = None


@dataclass(frozen=True)
class Folder:
    """Where a run writes the policy, the expert tree, the curve, the events and its checkpoints.

    Attributes:
        path: The folder; it is made if it does not exist.
        resume: Go on from the last checkpoint there, to the same bytes as if nothing had happened
            in between; as far as it was to go, if no budget is given.
        checkpoint_seconds: Time between two checkpoints; 0 saves one after every episode. None
            lets saving take at most a twentieth of the time. The result does not depend on it.
    """

    path: str | Path
    resume: bool = False
    checkpoint_seconds: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.path, str | Path):
            raise InvalidArgumentError(f"out must be the path of a folder, got {shown(self.path)}")
        check_measures(self, "checkpoint_seconds", low=0.0)


class ShortForms(TypedDict, total=False):
    """Plain words that ``learn`` takes: each is a part of a value, and builds it.

    Attributes:
        episodes: Of ``Budget``; also ``steps``, ``minutes`` and ``race_steps``.
        evaluate_every: ``every`` of ``Schedule``; ``evaluation_episodes`` is its ``episodes``.
        judge_episodes: ``episodes`` of ``Handover``; also its ``max_leaves``, ``front_steps``,
            ``keep_success``, ``return_range``, ``prefer_proven`` and ``against``.
        out: ``path`` of ``Folder``; also its ``resume`` and ``checkpoint_seconds``.
        on_progress: The function of a listener ``Progress``; likewise ``tensorboard``, ``stop``
            (``StopWhen``), and ``callback``, as Stable-Baselines3 has it.
        teacher: Who says how to act at observations that are met later, in place of the network
            that ``distilled-dqn`` would train; its training is not counted but declared.
        history: Number of previous observations that become features too, for what one observation
            does not show, such as a direction of movement.
        max_transitions: Most transitions that the learner remembers between two episodes, so that
            a run of any length takes bounded memory: a uniform sample of those of each leaf and
            action or, with planning, whole episodes. None leaves it to the method.
        strict: Refuse observations outside the environment's own bounds.
        monotone: Rules such as ``"stop in distance"`` that every policy of the run keeps, the start
            too; see ``eutree.inspection.keep_monotone``.
        starts: Certificates of trees that are not proven: half of all episodes, those of races,
            contests and evaluations too, begin where these fail (``eutree.proof.BeginningThere``).
    """

    episodes: int | None
    steps: int | None
    minutes: float | None
    race_steps: int
    evaluate_every: int
    evaluation_episodes: int
    judge_episodes: int | None
    max_leaves: int | None
    front_steps: int | None
    keep_success: bool
    return_range: tuple[float, float] | None
    prefer_proven: str | None
    against: Controller | None
    out: str | Path | None
    resume: bool
    checkpoint_seconds: float | None
    tensorboard: str | Path | None
    callback: CallbackLike | None
    stop: Callable[[], bool] | None
    on_progress: Callable[[Run], None] | None
    teacher: Teacher | None
    history: int
    max_transitions: int | None
    strict: bool
    monotone: Sequence[str]
    starts: "Sequence[Certificate]"


def _parts(same: str, **others: str) -> dict[str, str]:
    """Return the parts of a value by their words: some have the same name, in words apart."""
    return others | {name: name for name in same.split()}


_PARTS = {
    "budget": _parts("episodes steps minutes race_steps"),
    "evaluation": _parts("", evaluate_every="every", evaluation_episodes="episodes"),
    "handover": _parts(
        "max_leaves front_steps keep_success return_range prefer_proven against",
        judge_episodes="episodes",
    ),
    "folder": _parts("resume checkpoint_seconds", out="path"),
}
_LISTENERS: dict[str, Callable[[Any], Listener]] = {
    "tensorboard": TensorBoard,
    "callback": Callbacks,
    "stop": StopWhen,
    "on_progress": Progress,
}
_ALONE = ("teacher", "history", "max_transitions", "strict", "monotone", "starts")
_NAMED = ("demonstrations", "expert", "method", "start", *_PARTS, "listeners", "seed")
_KINDS = {"budget": Budget, "evaluation": Schedule, "handover": Handover, "folder": Folder}


@dataclass(frozen=True, eq=False, kw_only=True)
class Asked:
    """All that is asked of a run, by values alone; see ``ShortForms`` for those without one."""

    budget: Budget = Budget()
    evaluation: Schedule = Schedule()
    handover: Handover = field(default_factory=Handover)
    folder: Folder | None = None
    listeners: tuple[Listener, ...] = ()
    teacher: Teacher | None = None
    history: int = 0
    max_transitions: int | None = None
    strict: bool = False
    monotone: Sequence[str] = ()
    starts: "Sequence[Certificate]" = ()

    @classmethod
    def of(cls, values: Mapping[str, Any], listeners: object, short: Mapping[str, Any]) -> Self:
        """Return the request that values and plain words make.

        Args:
            values: The values by name, None where one is not given.
            listeners: One, or a sequence of them.
            short: As ``ShortForms`` has them.

        Raises:
            UnknownNameError: A word is not known.
            InvalidArgumentError: A value is of another kind, or is given and one of its words, too.
        """
        for word in short:
            if word not in ShortForms.__annotations__:
                raise UnknownNameError(
                    "argument of learn", word, [*ShortForms.__annotations__, *_NAMED]
                )
        many = listeners if isinstance(listeners, list | tuple) else [listeners]
        words = [word for word in _LISTENERS if short.get(word) is not None]
        following: list[Listener] = [_LISTENERS[word](short[word]) for word in words]
        built = {name: _built(name, values.get(name), short) for name in _PARTS}
        alone = {word: short[word] for word in _ALONE if word in short}
        given = {name: value for name, value in built.items() if value is not None}
        following += [one if isinstance(one, Listener) else Callbacks(one) for one in many]
        return cls(**given, **alone, listeners=tuple(following))

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of ``learn`` that ask for it, without folder and listeners."""
        names = ("budget", "evaluation", "handover", *_ALONE)
        return {name: getattr(self, name) for name in names}

    def going_on(self) -> Self:
        """Return the same; a run that is resumed has its first values, where none are named.

        That is its budget, and when it is evaluated.
        """
        if self.folder is None or not self.folder.resume:
            return self
        length, schedule = started(self.folder.path)
        budget, evaluation = self.budget, self.evaluation
        named = {name: value for name, value in vars(evaluation).items() if value is not None}
        return replace(
            self,
            budget=replace(budget, **length) if budget.is_open else budget,
            evaluation=replace(evaluation, **(schedule | named)),
        )


def _built(name: str, given: Any, short: Mapping[str, Any]) -> Any:
    """Return a value, of which words may say the parts; None where neither is given."""
    words = {word: part for word, part in _PARTS[name].items() if word in short}
    if given is None:
        parts = {part: short[word] for word, part in words.items()}
        if name != "folder" or parts.get("path") is not None:
            return _KINDS[name](**parts)
        for part, value in parts.items():
            if value is not None and value is not False:
                raise InvalidArgumentError(f"{part} needs the folder of a run (out), got none")
        return None
    if name == "folder" and isinstance(given, str | Path):
        given = Folder(given)
    check_kind(name, given, _KINDS[name])
    for word, part in words.items():
        if short[word] != getattr(_KINDS[name], part, None):
            raise InvalidArgumentError(f"{word} is a part of {name}, which is given: say it there")
    return given
