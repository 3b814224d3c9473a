"""``eutree record``: demonstrations by a person or a scripted expert."""

import html
import os
import shlex
import sys
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from eutree.cli import _options as option
from eutree.cli._output import Output, Result, progress, say
from eutree.cli._policies import OWN, controller, load_policy
from eutree.display import counted
from eutree.errors import EutreeError, InvalidArgumentError
from eutree.files import write_text
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    import gymnasium

    from eutree.data import Episode
    from eutree.recording import Recorder
    from eutree.recording.browser import PageServer
    from eutree.recording.tree_making import Guide, TreeMaker

_REDIRECT = '<!doctype html><meta http-equiv="refresh" content="0;url={}">\n'

# Of a page on which a person records: keys, pace, address
page_options = option.together(
    click.option("--keys", help="What the keys mean: left=0,right=1,none=0 (numbers or names)."),
    click.option("--hud", is_flag=True, help="Show the person the numbers that the agent senses."),
    click.option("--fps", type=click.FloatRange(0, 240, min_open=True),
                 help="Decisions per second; the environment's own pace if not given."),
    click.option("--port", type=click.IntRange(0, 65535),
                 help="Port of the page; 0 for any. Default: 8765 or the next."),
    click.option("--host", default="127.0.0.1", show_default=True,
                 help="Address of the page; others than this let other machines in."),
)  # fmt: skip


@option.command("eutree record eutree/Evasion2-v0 --out demos/")
@click.argument("environment")
@option.output("--out", text="Folder to write; a person continues one that exists.")
@option.count("--episodes", 15, "How many episodes.")
@click.option("--drive", type=click.Path(path_type=Path), metavar="TREE",
              help="Let this tree drive, and take over from it where it is wrong.")  # fmt: skip
@click.option("--web", is_flag=True, help="A person records in a browser, as without --expert.")
@click.option("--study", type=click.Path(path_type=Path), metavar="FOLDER",
              help="Lead one person through a study.")  # fmt: skip
@click.option("--person", metavar="CODE", help="Go on with this person of the --study.")
@page_options
@click.option("--expert", help=f"A scripted expert, for example gate, or your own, {OWN}: a "
              "policy, its class, or a function.")  # fmt: skip
@click.option("--careless", type=click.FloatRange(0, 1), default=0.0, show_default=True,
              help="Share of random actions of the scripted expert.")  # fmt: skip
@option.starts("the episodes begin where it failed.")
@option.environment
@option.seed
def record(
    environment: str,
    out: Path | None,
    study: Path | None,
    person: str | None,
    episodes: int,
    expert: str | None,
    careless: float,
    web: bool,
    keys: str | None,
    hud: bool,
    fps: float | None,
    starts_from: Path | None,
    env_arguments: dict[str, Any],
    seed: int,
    **page: Any,
) -> Result | None:
    """Record demonstrations in ENVIRONMENT, by a person or by a scripted expert."""
    from eutree.recording import Recorder, SessionSettings

    spec = EnvironmentSpec(environment, env_arguments)
    if expert is not None:
        if web:
            raise InvalidArgumentError("choose one of --expert and --web")
        option.refuse(("drive", "keys", "hud", "fps", "port", "host"), "--expert opens no page")
    if study is not None:
        _lead(environment, study, person=person, keys=keys, hud=hud, fps=fps,
              as_json=option.wants_json(), env_arguments=env_arguments, **page)  # fmt: skip
        return None
    if person is not None:
        raise InvalidArgumentError("--person needs --study")
    if out is None:
        raise click.MissingParameter(param_hint="'--out'", param_type="option")
    env = _made(spec, starts_from, seen=expert is None)
    if expert is not None:
        return _recorded_expert(
            spec, env, out, expert, episodes=episodes, careless=careless, seed=seed
        )
    settings = SessionSettings(
        target=episodes, seed=seed, fps=fps, hud=hud, viewer="browser", makes=True
    )
    recorder = Recorder(env, out, keys=keys, settings=settings)
    if recorder.recovered:
        numbers = ", ".join(map(str, recorder.recovered))
        say(f"recovered interrupted episode {numbers} from a recorder that died")
    record_on_page(Output(as_json=False), recorder, spec, out, **page)
    kept = [episode for episode in recorder.session.episodes if episode.kept]
    steps = sum(map(len, kept))
    return Result(
        {"episodes": len(kept), "n_transitions": steps, "path": str(out)},
        f"{counted(len(kept), 'episode')}, {counted(steps, 'transition')}, in {out}",
    )


def _lead(environment: str, study: Path, **given: Any) -> None:
    """Lead one person through a study, by the command of the distribution that has one."""
    context = click.get_current_context()
    decided = ("out", "episodes", "seed", "expert", "careless", "drive", "starts_from", "web")
    option.refuse(decided, "--study decides it by its study.toml")
    commands = context.find_root().command
    studies = commands.get_command(context, "study") if isinstance(commands, click.Group) else None
    lead = studies.get_command(context, "lead") if isinstance(studies, click.Group) else None
    if lead is None:
        raise InvalidArgumentError("--study needs the command `eutree study lead`: none has it")
    del given["drive"]  # the tree of the study drives
    context.invoke(lead, folder=study, environment=environment, **given)


def make_seen(spec: EnvironmentSpec) -> "gymnasium.Env[Any, Any]":
    """Return the environment for a person, who sees what it draws."""
    from eutree.interaction.making import make

    with closing(make(spec)) as env:
        modes = env.metadata.get("render_modes") or ()
    if "rgb_array" not in modes:
        raise InvalidArgumentError(
            f"{spec} must draw what a person sees: its metadata['render_modes'] must hold "
            f"'rgb_array', and its constructor take render_mode; got {list(modes)}"
        )
    return make(spec, render_mode="rgb_array")


def _made(
    spec: EnvironmentSpec, starts_from: Path | None, *, seen: bool
) -> "gymnasium.Env[Any, Any]":
    """Return the environment, whose episodes begin where a certificate failed, if one is named."""
    from eutree.interaction.making import make
    from eutree.proof import BeginningThere, load_certificate

    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    env = make_seen(spec) if seen else make(spec)
    if starts_from is None:
        return env
    certificate = load_certificate(starts_from)
    there = BeginningThere(env, [certificate])
    boxes = 0 if certificate.starts is None else len(certificate.starts.low)
    say(f"show it from {counted(boxes, 'region')} of the starts: {certificate}")
    return there


def _recorded_expert(
    spec: EnvironmentSpec,
    env: "gymnasium.Env[Any, Any]",
    out: Path,
    expert: str,
    *,
    episodes: int,
    careless: float,
    seed: int,
) -> Result:
    from eutree.envs import experts
    from eutree.files import check_new_folder
    from eutree.interaction.acting import FullPolicy, as_policy
    from eutree.recording import record as record_episodes

    check_new_folder(out)
    shows = controller(expert, "--expert", spec)
    if careless:
        careful = shows

        def full(env: "gymnasium.Env[Any, Any]") -> FullPolicy:
            return FullPolicy(as_policy(careful, env))

        full.__name__ = str(getattr(careful, "__name__", type(careful).__name__))
        shows = experts.careless(full, careless, seed=seed)
    finished = 0
    try:
        with progress("recording", episodes) as line:

            def show(number: int, episode: "Episode") -> None:
                nonlocal finished
                finished = number + 1
                line.update(finished, episode.ending)

            demos = record_episodes(
                env, shows, episodes=episodes, seed=seed, out=out, on_episode=show
            )
    except (KeyboardInterrupt, EutreeError):
        if finished:
            say(f"{counted(finished, 'finished episode')} kept in {out}")
        raise
    successes = [episode.is_success for episode in demos if episode.is_success is not None]
    result = f", {sum(successes)} successful" if successes else ""
    return Result(
        {"episodes": len(demos), "n_transitions": demos.n_transitions, "path": str(out)},
        f"{counted(len(demos), 'episode')}, {counted(demos.n_transitions, 'transition')}{result}, "
        f"written to {out}",
    )


def record_on_page(
    output: Output,
    recorder: "Recorder",
    spec: EnvironmentSpec,
    out: Path,
    *,
    host: str,
    port: int | None,
    drive: Path | None = None,
    lead: "tuple[TreeMaker, Guide] | None" = None,
) -> None:
    """Let a person record on a page of the browser, whose address is said, until they finish.

    A tree to ``drive`` does so from the beginning. ``lead`` are the maker of the tree and the guide
    of the person; None where they lead themselves.
    """
    from eutree.fitting.page_tree import PageTree
    from eutree.interaction.making import make
    from eutree.recording.browser import record_in_browser
    from eutree.recording.browser.wire import is_loopback

    maker = PageTree(out, lambda: make(spec), seed=recorder.session.settings.seed)
    maker.imported = option.imported()
    tree = None if drive is None else load_policy(drive)
    if tree is not None:
        recorder.session.env.schema.check_same(
            tree.schema, f"--drive {drive}", of="the environment"
        )

    def ready(server: "PageServer") -> None:
        if tree is not None:
            recorder.session.driving.offer(maker.driving(tree, server.show_tree))
        if not is_loopback(host):
            output.say(
                f"warning: other machines can reach this page at {host}, unencrypted; whoever has "
                "the address below can record. An SSH tunnel to 127.0.0.1 is safer."
            )
        output.say(f"open {server.url}")
        if is_loopback(host) and not opens(server.url):
            output.say(
                f"from another machine, first: ssh -L {server.port}:127.0.0.1:{server.port} "
                "THIS-MACHINE"
            )

    steps = (("demos", "stats", str(out), "--html", "demos.html"),
             ("fit", str(out), "--out", "expert.json", *maker.imported),
             ("show", "expert.json"))  # fmt: skip
    with opened_by() as opens:
        record_in_browser(
            recorder,
            host=host,
            port=port,
            details={"commands": [] if lead else [shlex.join(["eutree", *step]) for step in steps]},
            maker=lead[0] if lead else maker,
            guide=lead[1] if lead else None,
            on_ready=ready,
        )


@contextmanager
def opened_by() -> Iterator[Callable[[str], bool]]:
    """Yield the opener of addresses on this desktop; its files are deleted at the end.

    An address with a token is no argument for another program: every user of the machine could
    read it. So the browser is handed a file that only this user can read, and that leads there.
    """
    with TemporaryDirectory(prefix="eutree-") as folder:
        yield partial(_open, Path(folder) / "open.html")


def _open(page: Path, url: str) -> bool:
    """Open an address in a browser; return False where there is none, or nobody to see it."""
    if not _has_desktop():
        return False
    write_text(page, _REDIRECT.format(html.escape(url)))
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if type(browser) is webbrowser.GenericBrowser:
        return False  # one that lives in the terminal: it would wait to be left
    return browser.open(page.as_uri())


def _has_desktop() -> bool:
    """Return whether a person sits at a terminal on the desktop of this machine."""
    if not sys.stderr.isatty() or "SSH_CONNECTION" in os.environ:
        return False
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
