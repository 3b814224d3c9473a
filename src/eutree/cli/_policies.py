"""Who acts, by name: a policy's file or run folder, a scripted expert, or one of the user's own."""

import importlib
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from eutree.cli._options import look_in_this_folder
from eutree.errors import InvalidArgumentError, UnknownNameError, described
from eutree.schema import EnvironmentSpec
from eutree.validation import elsewhere

if TYPE_CHECKING:
    from eutree.arrays import Floats
    from eutree.data import Demonstrations
    from eutree.evaluation import Against, Evaluation
    from eutree.interaction.acting import Controller
    from eutree.interaction.names import Names
    from eutree.policies import TreePolicy

OWN = "MODULE:NAME or FILE.py:NAME"
_HINT = f"One of your own is named {OWN}: a policy, its class, or a function."


def in_zoo(path: Path | str) -> bool:
    """Return whether a tree of the zoo is named, ``zoo:NAME``, and not a file."""
    return str(path).startswith("zoo:") and not Path(path).exists()


def load_policy(path: Path, *, hand_edited: bool = False) -> "TreePolicy":
    """Return the policy in a file, or the one that a run folder ended with, with ``--names``.

    With ``hand_edited`` the file may have been changed after it was written. A tree of one
    observation without derived features knows those that are declared, and asks for none.
    """
    from eutree.interaction.names import given_names
    from eutree.policies import TreePolicy

    policy, names = TreePolicy.load(policy_file(path), hand_edited=hand_edited), given_names()
    if names is None:
        return policy
    policy = renamed(policy, names)
    if policy.schema.derived or not policy.features.is_identity:
        return policy
    schema = policy.schema.derive(names.derived)
    return replace(policy, schema=schema, tree=replace(policy.tree, n_features=schema.n_features))


def load_demonstrations(path: Path, policy: "TreePolicy | None" = None) -> "Demonstrations":
    """Return the demonstrations in a folder, with the features that are derived elsewhere.

    These are the features that the policy needs, whatever was recorded, or else those that
    ``--derive`` declares. Where numbers stand for names, they get those of ``--names``.
    """
    from eutree.data import Demonstrations, derive
    from eutree.features import Derivation
    from eutree.interaction.names import Names, given_names

    demonstrations, names = Demonstrations.load(path), given_names()
    if names is not None:
        schema = demonstrations.schema
        named = Names(features=names.features, actions=names.actions).of(schema)
        if schema.is_unnamed_form_of(named):
            demonstrations = replace(demonstrations, schema=schema.with_names_of(named))
    known = Derivation.of(demonstrations.schema).formulas
    if policy is not None and policy.schema.derived:
        if known != policy.derivation.formulas:
            demonstrations = derive(demonstrations, policy.schema.derived, anew=True)
    elif names is not None and names.derived and not known:
        demonstrations = derive(demonstrations, names.derived)
    if policy is not None:
        _check_task(path, demonstrations, policy)
    return demonstrations


def _check_task(path: Path, recorded: "Demonstrations", policy: "TreePolicy") -> None:
    """Raise InvalidArgumentError unless demonstrations are of the policy's task."""
    here, there = (of.environment.id if of.environment else "" for of in (recorded, policy))
    sizes = recorded.schema.n_features, recorded.schema.n_actions
    wanted = policy.observation_size, policy.schema.n_actions
    names = recorded.schema.feature_names, policy.schema.feature_names[: wanted[0]]
    if sizes != wanted or (here and there and here != there and names[0] != names[1]):
        raise InvalidArgumentError(
            f"{path} must hold demonstrations of the policy's task {there} (features, actions: "
            f"{wanted}), got {here} {sizes}"
        )
    if not here or here != there:
        # Other names may be those of a log; the policy's own at other places are another order.
        for given, own in (names, (recorded.schema.actions, policy.schema.actions)):
            if elsewhere(given, own):
                raise InvalidArgumentError(
                    f"{path} must have the names of the policy in their order, {', '.join(own)}, "
                    f"got {', '.join(given)}"
                )


def seen_in(demos: Path, policy: "TreePolicy") -> "Floats":
    """Return the features before each decision in a folder of demonstrations, [N, d]."""
    recorded = load_demonstrations(demos, policy)
    return recorded.with_history(policy.history, policy.past_actions).observations


def seen_in_run(run: Path, policy: "TreePolicy") -> "Floats":
    """Return the features before each decision that the learner of a run stored, [N, d]."""
    from eutree.training import stored_observations

    if (run / "policy.json").exists():
        pair = load_policy(run), policy
        here, there = (of.environment.id if of.environment else "" for of in pair)
        one, other = (of.schema.feature_names[: of.derivation.n_measured] for of in pair)
        if len(one) != len(other) or (here and there and here != there and one != other):
            raise InvalidArgumentError(
                f"{run} must be a run of the policy's task {there} ({len(other)} features), got "
                f"{here} ({len(one)} features)"
            )
    return policy.derivation.behind(stored_observations(run))


def renamed(policy: "TreePolicy", names: "Names") -> "TreePolicy":
    """Return a policy with these names; those of the past follow. Nothing is derived."""
    from eutree.schema import Schema

    known, size = policy.schema, policy.observation_size
    schema = names.of(Schema(known.features[:size], known.actions, known.controls))
    return replace(policy, schema=schema.with_history(policy.history, policy.past_actions))


def policy_file(path: Path) -> Path:
    """Return the policy's file: of the zoo, ``path`` itself, or ``policy.json`` in a run folder."""
    if in_zoo(path):
        from eutree.zoo import path_of

        return path_of(str(path))
    if path.suffix in (".csv", ".npz"):
        raise InvalidArgumentError(
            f"{path} must be a policy file; a log is read by eutree demos import, and fit makes a "
            "policy of it"
        )
    if not path.is_dir():
        return path
    file = path / "policy.json"
    if not file.exists() or (path / "demonstrations.json").exists():
        raise InvalidArgumentError(
            f"{path} must be a policy file, or a run folder with a policy.json, which a run "
            "writes at its end"
        )
    return file


def check_fits(policy: "TreePolicy", path: Path, spec: "EnvironmentSpec") -> None:
    """Raise InvalidArgumentError unless the policy's features are those of the environment."""
    from eutree.interaction.deriving import acting_for
    from eutree.interaction.making import make

    acting_for(make(spec), policy, str(path))


def controller(name: str, option: str, spec: EnvironmentSpec) -> "Controller":
    """Return the actor that an option names for an environment.

    That is a scripted expert of it, a policy file or run folder, or ``MODULE:NAME`` or
    ``FILE.py:NAME``: anything with SB3's ``predict``, its class, a function that makes such a thing
    for an environment, or one from an observation to an action.

    Raises:
        UnknownNameError: The name means none of these.
        InvalidArgumentError: The module cannot be imported, or the policy is of another task.
    """
    from eutree.envs.experts import known_experts

    known = known_experts(spec.id)
    if name in known:
        return known[name]
    if is_own(name):
        return _own(name, option)
    path = policy_file(Path(name))
    if path.suffix == ".py":
        raise InvalidArgumentError(f"{option} {name}: name what decides in it: {name}:NAME")
    if not path.exists():
        raise UnknownNameError(option, name, known, hint=_HINT)
    policy = load_policy(path)
    check_fits(policy, path, spec)
    return policy


def is_own(name: str) -> bool:
    """Return whether a name is that of something in a module, and not of a file."""
    return ":" in name and not Path(name).exists() and not in_zoo(name)


def _own(name: str, option: str) -> "Controller":
    """Return the object that ``MODULE:NAME`` or ``FILE.py:NAME`` names."""
    module, _, attribute = name.rpartition(":")
    found: Any = _imported(module, f"{option} {name}")
    for part in attribute.split("."):
        if not hasattr(found, part):
            raise InvalidArgumentError(f"{option} {name}: {module} has no {attribute!r}")
        found = getattr(found, part)
    return cast("Controller", found)


def _imported(module: str, what: str) -> object:
    """Import a module that the user has named; its author is told of its errors."""
    look_in_this_folder()
    if module.endswith(".py"):
        file = Path(module).resolve()
        if not file.is_file():
            raise InvalidArgumentError(f"{what}: there is no file {module}")
        if str(file.parent) not in sys.path:  # where other processes look for it, too
            sys.path.insert(0, str(file.parent))
        module = file.stem
    if not all(part.isidentifier() for part in module.split(".")):
        raise InvalidArgumentError(f"{what}: must be {OWN}")
    try:
        return importlib.import_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise InvalidArgumentError(
            f"{what}: cannot import {module!r}: {described(error)}"
        ) from error


against_option = click.option(
    "--against",
    metavar="NAME",
    help=f"Play the same episodes with another: an expert, a policy file, {OWN}.",
)


def set_against(
    rival: "Controller | None",
    spec: EnvironmentSpec,
    policy: "Evaluation",
    *,
    name: str | None,
    seed: int,
    n_jobs: int | None,
) -> "Against | None":
    """Let a rival, if there is one, play the episodes that a policy has played; compare both."""
    from eutree.evaluation import against, evaluate
    from eutree.interaction.first_look import return_range
    from eutree.interaction.making import make

    if rival is None:
        return None
    other = evaluate(rival, spec, episodes=policy.episodes, seed=seed, n_jobs=n_jobs)
    with closing(make(spec)) as env:
        return against(policy, other, known=return_range(env), name=name or "")


def beside(found: "Against | None") -> str:
    """Return the results of a policy and of its rival, a line each, to follow other lines."""
    return "" if found is None else f"\nthe result: {found.policy}\n{found}"
