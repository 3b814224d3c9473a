"""The arguments of ``eutree learn``: a method with its settings, and the same again on resuming.

A run goes on from its folder alone: the arguments of its command are kept there, and given again. A
module to import, an address to work at and a folder elsewhere to write are the user's own choice
each time, and of an environment's arguments those that no file may choose; the line that is printed
when a run is interrupted has them.
"""

import json
import os
import shlex
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import click
import msgspec

from eutree.cli._options import Helped, Written, give, look_in_this_folder
from eutree.cli._output import say
from eutree.cli._policies import controller, in_zoo, is_own
from eutree.data import Demonstrations
from eutree.errors import FileError, FormatError, InvalidArgumentError, blamed, shown
from eutree.files import Document, read_bytes, read_document, write_document
from eutree.interaction.making import make
from eutree.interaction.names import Names, given_names
from eutree.recording import record
from eutree.schema import EnvironmentSpec
from eutree.zoo import settings_of, tasks

if TYPE_CHECKING:
    from eutree.learners import Method

KEPT = "command.json"
# Asked for each time: none changes the result of a run.
_EACH_TIME = {"out", "resume", "as_json", "list_settings", "checkpoint_seconds", "n_jobs"}
_USERS_OWN = {"import", "backend", "address", "tensorboard"}
_NAMED = {"teacher", "against"}  # a file, a scripted expert, or MODULE:NAME

_ENV_ARG = "env_arguments"
# In click's context: the arguments on the line, and the environment's that come from the file.
_GIVEN, _FROM_FILE, _IS_KEPT = "eutree.given", "eutree.from_file", "eutree.is_kept"

Arguments = dict[str, list[str]]  # the texts given for each parameter, by its name
# The settings to change first, by method; those found to matter most come first.
FIRST = {
    "planning": ("planner.improvement.price", "planner.explorer_share", "gathering_episodes"),
    "u-tree": ("significance.alpha", "splitter.min_leaf", "discount"),
}
_MOST = 2**20  # bytes of a file of settings


class CommandDocument(Document, frozen=True, kw_only=True):
    """The arguments of a command, by the names of its parameters; paths are absolute."""

    FORMAT: ClassVar[str] = "eutree/command"
    VERSION: ClassVar[int] = 1

    arguments: Arguments


class GoesOn(Helped):
    """A command that with ``--resume`` is given again the arguments in the folder ``--out``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments, those kept first."""
        ctx.meta[_GIVEN] = given = _given(self, ctx, args)
        if "resume" in given and "out" in given:
            out = Path(given["out"][0])
            kept = _without(_kept(out, given), given)
            if not kept and not _was_begun(out):
                del given["resume"]  # the new run is kept without it
                click.echo(f"{out} holds no run to go on with: a new one begins", err=True)
            ctx.meta[_FROM_FILE] = {_key(text) for text in kept.get(_ENV_ARG, [])}
            args = [*_line(self, kept), *args]
        return super().parse_args(ctx, args)


def chosen_by_file(arguments: dict[str, Any]) -> frozenset[str]:
    """Return which of an environment's arguments were kept in a folder, and not given now."""
    return frozenset(click.get_current_context().meta.get(_FROM_FILE, set()) & arguments.keys())


def keep(out: Path, *, begun: bool = True) -> None:
    """Keep in a run's folder the arguments of the command; in one begun before those that are new.

    Only the first call in a command keeps anything. Where no run has ``begun`` none is replaced.
    """
    context = click.get_current_context()
    given, path = context.meta[_GIVEN], out / KEPT
    may_keep = path.exists() if "resume" in given else begun or not path.exists()
    if context.meta.get(_IS_KEPT) or not (out.is_dir() and may_keep):
        return
    context.meta[_IS_KEPT] = True
    before = _without(_kept(out, given), given) if "resume" in given else {}
    not_kept = _EACH_TIME | _of_the_user(given).keys()
    parameters = {str(one.name): one for one in context.command.params}
    kept = {
        name: [_absolute(parameter, text) for text in given[name]]
        for name, parameter in parameters.items()
        if name in given and name not in not_kept
    }
    own = before.get(_ENV_ARG, []) + kept.get(_ENV_ARG, [])
    arguments = before | kept | ({_ENV_ARG: own} if own else {})
    write_document(path, CommandDocument(arguments=arguments))


def line_to_go_on(out: Path) -> str:
    """Return the line by which a run goes on, quoted for a shell."""
    context = click.get_current_context()
    given = context.meta[_GIVEN]
    users = _of_the_user(given) | {n: t for n, t in given.items() if n == _ENV_ARG}
    own = users if (out / KEPT).exists() else given
    own = {name: texts for name, texts in own.items() if name not in {"out", "resume"}}
    words = ["eutree", str(context.command.name), *_line(context.command, own)]
    return shlex.join([*words, "--out", str(out), "--resume"])


def _of_the_user(given: Arguments) -> Arguments:
    """Return the arguments that no file may choose, but for those of the environment."""
    return {name: texts for name, texts in given.items() if _is_users_own(name, texts)}


def _is_users_own(name: str, texts: list[str]) -> bool:
    """Return whether no file may choose an argument: MODULE:NAME imports a module."""
    named = name in _NAMED and any(is_own(text) for text in texts)
    imports = name in ("environment", "method") and any(":" in text for text in texts)
    return imports or named or name in _USERS_OWN


def _given(command: click.Command, context: click.Context, args: list[str]) -> Arguments:
    """Return the arguments on the line, by the names of the parameters; none if it is wrong."""
    try:
        values, _, order = command.make_parser(context).parse_args(list(args))
    except click.UsageError:
        return {}  # click itself says so
    named = {str(parameter.name): values[str(parameter.name)] for parameter in order}
    for option in order:
        if not isinstance(named[str(option.name)], str | list | tuple | bool):
            named[str(option.name)] = getattr(option, "flag_value", None)  # it stands there alone
    return {
        name: [str(text) for text in (value if isinstance(value, list | tuple) else [value])]
        for name, value in named.items()
        if isinstance(value, str | list | tuple | bool)
    }


def _was_begun(out: Path) -> bool:
    return any((out / name).exists() for name in (KEPT, "config.json", "runs"))


def _kept(out: Path, given: Arguments) -> Arguments:
    """Return the arguments kept in a folder; none where the whole command is given again."""
    if (out / KEPT).exists():
        arguments = read_document(out / KEPT, CommandDocument).arguments
        for name, texts in sorted(arguments.items()):
            if name in _EACH_TIME or _is_users_own(name, texts):
                raise FormatError(out / KEPT, "arguments", f"no file may choose {name!r}")
        return arguments
    if not {"environment", "demos"} & given.keys():
        raise InvalidArgumentError(
            f"{out} was not begun by this command, so give again all that it was begun with"
            if _was_begun(out)
            else f"--out must be the folder of a run that is to go on, got {out}, which holds none"
        )
    return {}


def _without(kept: Arguments, given: Arguments) -> Arguments:
    """Return the arguments kept and not given now; of the environment's each by itself."""
    rest = {name: texts for name, texts in kept.items() if name not in given}
    now = {_key(text) for text in given.get(_ENV_ARG, [])}
    own = [text for text in kept.get(_ENV_ARG, []) if _key(text) not in now]
    return rest | ({_ENV_ARG: own} if own else {})


def _key(text: str) -> str:
    return text.partition("=")[0]


def _line(command: click.Command, arguments: Arguments) -> list[str]:
    """Return the words that give arguments to a command."""
    known, words = {str(one.name): one for one in command.params}, []
    for name, texts in arguments.items():
        parameter = known.get(name)
        if parameter is None:
            raise InvalidArgumentError(f"{KEPT} must hold arguments of the command, got {name!r}")
        flag = [parameter.opts[-1]] if isinstance(parameter, click.Option) else []
        is_flag = isinstance(parameter, click.Option) and parameter.is_flag
        size = parameter.nargs if flag else 1
        for place in range(0, len(texts), size):
            words += flag if is_flag else [*flag, *texts[place : place + size]]
    return words


def _absolute(parameter: click.Parameter, text: str) -> str:
    """Return a path as it is known from everywhere, and any other text as it is."""
    is_path = isinstance(parameter.type, click.Path) and not isinstance(parameter.type, Written)
    if parameter.name in _NAMED:
        is_path = os.path.exists(text)
    return os.path.abspath(text) if is_path and not in_zoo(text) else text


class RunSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a run goes that settings are known to work for: the table ``[run]`` of their file."""

    task: str = ""  # id of the environment that they are for; "" where they do not say it
    expert: str | None = None  # who demonstrates where no demonstrations are given; None for nobody
    demonstrations: int = 0  # the number of its episodes
    # Share of ``--steps`` that racing takes where no ``--race-steps`` are given
    race_share: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.0
    # Of the environment, where neither the user nor demonstrations say otherwise
    arguments: dict[str, Any] = {}
    derived: tuple[str, ...] = ()  # declarations as for ``--derive``, where the user gives none

    @classmethod
    def of(cls, settings: Path | None) -> "RunSettings":
        """Return those of a file of settings; a file without the table has none.

        Raises:
            FormatError: The table has an unknown entry, or one of a wrong kind.
        """
        if settings is None:
            return cls()
        with blamed(settings, "run", msgspec.ValidationError):
            return msgspec.convert(_read(settings).get("run", {}), cls)

    def declare_derived(self, context: click.Context) -> None:
        """Declare its derived features for every environment that the command makes."""
        given = given_names()
        if self.derived and not (given and given.derived):
            give(context, Names(derived=self.derived))

    def shown(self, spec: EnvironmentSpec, seed: int) -> Demonstrations | None:
        """Return the episodes of who demonstrates, recorded now."""
        if self.expert is None:
            return None
        try:
            env = make(spec)
            shows = controller(self.expert, "expert", spec)
        except InvalidArgumentError as error:
            if self.task in ("", spec.id.rpartition(":")[2]):
                raise
            words = f"the settings are of {self.task}, not of {spec.id}: {error}"
            raise InvalidArgumentError(words) from error
        return record(env, shows, episodes=self.demonstrations, seed=seed)

    def race_steps(self, steps: int | None) -> int:
        """Return the steps of racing in a run of so many; none where no steps are named."""
        racing = int(self.race_share * (steps or 0))
        if racing:
            say(f"race_steps is {racing} of the {steps} steps, by the race_share of the settings")
        return racing


def chosen_method(
    name: str | None,
    *,
    offline: bool,
    settings: Path | None,
    changes: tuple[str, ...],
    discount: float | None,
) -> "Method | str | None":
    """Return the method of a name, with the settings that a file and ``--set`` change."""
    from eutree.learners import method as method_of
    from eutree.learners.registry import with_choices

    if name == "auto":
        name = None
    elif name is not None and ":" in name:
        look_in_this_folder()
    if settings is None and not changes and discount is None:
        return name
    document = {} if settings is None else dict(_read(settings))
    document.pop("run", None)
    stored = document.pop("method", document.pop("name", None))
    if isinstance(stored, dict):  # the configuration of a run
        document = dict(stored)
        stored = document.pop("name", None)
    if not isinstance(stored, str | None):
        raise InvalidArgumentError(f"{settings}: method must be a name, got {shown(stored)}")
    if name and stored and stored not in (name, method_of(name).name):
        raise InvalidArgumentError(f"{settings}: method must be {name!r} as asked, got {stored!r}")
    method = method_of(name or stored or ("corrected" if offline else "default"))
    given = dict(_pair(text) for text in changes)
    if discount is not None and "discount" in given:
        raise InvalidArgumentError("--discount and --set discount say the same; leave out one")
    given |= {} if discount is None else {"discount": discount}
    with blamed(settings or ""):
        method = with_choices(method, document)
    return with_choices(method, given)


def listed(method: "Method | str | None", *, offline: bool) -> tuple[dict[str, Any], str]:
    """Return all settings of a method, for ``--json`` and as a text, the first to change on top."""
    from eutree.learners import method as method_of
    from eutree.learners.registry import choices_of

    if method is None or isinstance(method, str):
        method = method_of(method or ("corrected" if offline else "default"))
    first = FIRST.get(method.name, ())
    known = choices_of(method)
    order = sorted(known, key=lambda one: (*first, one.name).index(one.name))
    lines = [f"{method.name}: --set NAME=VALUE; turn first what is marked with *"]
    for choice in order:
        mark = "*" if choice.name in first else " "
        lines.append(f"{mark} {choice.name} = {json.dumps(choice.value)}\n      {choice.text}")
    settings = {choice.name: choice.value for choice in known}
    values = {"method": method.name, "first": list(first), "settings": settings}
    return values, "\n".join(lines)


def _pair(text: str) -> tuple[str, Any]:
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise InvalidArgumentError(f"--set must be KEY=VALUE, got {text!r}")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):
        return name, value


def _read(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file, or of the JSON file of a run's configuration."""
    if in_zoo(path):
        path = settings_of(str(path))
    elif not path.exists() and str(path) in tasks():
        raise FileError("read", path, f"no such file; those of the zoo are --settings zoo:{path}")
    data = read_bytes(path, limit=_MOST)
    with blamed(path, "document", (ValueError, RecursionError)):
        if path.suffix != ".json":
            return tomllib.loads(data.decode())
        found = json.loads(data)
    if not isinstance(found, dict) or not isinstance(found.get("method"), dict):
        raise FormatError(path, "method", "must be there: the configuration of a run")
    return {"method": found["method"]}
