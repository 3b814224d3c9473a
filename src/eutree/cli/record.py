"""``eutree record``: demonstrations by a person or a scripted expert."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli._options import count_option, env_arg_option, json_option, path_option, seed_option
from eutree.cli._output import Output
from eutree.errors import EutreeError, InvalidArgumentError
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.data import Episode
    from eutree.interaction import Recorder
    from eutree.interaction.browser import PageServer


@dataclass(frozen=True)
class Place:
    """Where a person records: in a window of this desktop, or on a page of a local server.

    Attributes:
        window: Whether it is a window.
        host: Address of the page.
        port: Its port; 0 for any, None for the usual one or the next.
    """

    window: bool
    host: str
    port: int | None


@click.command(epilog="Example: eutree record eutree/Evasion2-v0 --web --out demos/")
@click.argument("environment")
@path_option("--out", text="Folder to write; a person continues one that exists.", required=True)
@count_option("--episodes", 15, "How many episodes.")
@click.option("--web", is_flag=True, help="A person records in a browser (the default).")
@click.option("--window", is_flag=True, help="A person records in a window of this desktop.")
@click.option("--keys", help="What the keys mean: left=0,right=1,none=0 (numbers or names).")
@click.option("--hud", is_flag=True, help="Show the person the numbers that the agent senses.")
@click.option("--fps", type=click.FloatRange(0, 240, min_open=True),
              help="Decisions per second; the environment's own pace if not given.")  # fmt: skip
@click.option("--port", type=click.IntRange(0, 65535),
              help="Port of the page; 0 for any. Default: 8765 or the next.")  # fmt: skip
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Address of the page; others than this let other machines in.")  # fmt: skip
@click.option("--expert", help="A scripted expert, for example gate or look-ahead.")
@click.option("--careless", type=click.FloatRange(0, 1), default=0.0, show_default=True,
              help="Share of random actions of the scripted expert.")  # fmt: skip
@env_arg_option
@seed_option
@json_option
def record(
    environment: str,
    out: Path,
    episodes: int,
    expert: str | None,
    careless: float,
    web: bool,
    window: bool,
    host: str,
    port: int | None,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
    **person: Any,
) -> None:
    """Record demonstrations in ENVIRONMENT, by a person or by a scripted expert."""
    output = Output(as_json=as_json)
    spec = EnvironmentSpec(environment, env_arguments)
    if expert is not None:
        if web or window:
            raise InvalidArgumentError("choose one of --expert, --web and --window")
        _record_expert(output, spec, out, expert, episodes=episodes, careless=careless, seed=seed)
    else:
        if web and window:
            raise InvalidArgumentError("choose one of --web and --window")
        place = Place(window, host, port)
        _record_person(output, spec, out, place=place, episodes=episodes, seed=seed, **person)


def _record_expert(
    output: Output,
    spec: EnvironmentSpec,
    out: Path,
    expert: str,
    *,
    episodes: int,
    careless: float,
    seed: int,
) -> None:
    from eutree.envs import experts
    from eutree.files import check_new_folder
    from eutree.interaction import record as record_episodes
    from eutree.interaction.making import make
    from eutree.validation import check_choice

    check_new_folder(out)
    env = make(spec)
    known = experts.experts_for(spec.id)
    controller = known[check_choice("--expert", expert, known)]
    if careless:
        controller = experts.careless(controller, careless, seed=seed)
    finished = 0
    try:
        with output.progress("recording", episodes) as progress:

            def show(number: int, episode: "Episode") -> None:
                nonlocal finished
                finished = number + 1
                progress.update(finished, episode.ending)

            demos = record_episodes(
                env, controller, episodes=episodes, seed=seed, out=out, on_episode=show
            )
    except (KeyboardInterrupt, EutreeError):
        if finished:
            output.say(f"{finished} finished episodes are in {out}")
        raise
    successes = [episode.is_success for episode in demos if episode.is_success is not None]
    result = f", {sum(successes)} successful" if successes else ""
    output.result(
        {"episodes": len(demos), "n_transitions": demos.n_transitions, "path": str(out)},
        f"{len(demos)} episodes, {demos.n_transitions} transitions{result}, written to {out}",
    )


def _record_person(
    output: Output,
    spec: EnvironmentSpec,
    out: Path,
    *,
    episodes: int,
    seed: int,
    place: Place,
    keys: str | None,
    hud: bool,
    fps: float | None,
) -> None:
    import os

    from eutree.interaction import Recorder, SessionSettings
    from eutree.interaction.making import make
    from eutree.interaction.window import record_in_window

    window = place.window
    if not window:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    viewer = "window" if window else "browser"
    settings = SessionSettings(
        target=episodes, seed=seed, fps=fps, hud=hud, viewer=viewer, makes=not window
    )
    recorder = Recorder(make(spec, render_mode="rgb_array"), out, keys=keys, settings=settings)
    if recorder.recovered:
        numbers = ", ".join(map(str, recorder.recovered))
        output.say(f"recovered interrupted episode {numbers} from a recorder that died")
    if window:
        record_in_window(recorder)
    else:
        _record_in_browser(output, recorder, spec, out, host=place.host, port=place.port)
    kept = [episode for episode in recorder.session.episodes if episode.kept]
    steps = sum(map(len, kept))
    if window and kept:
        output.say(
            f"eutree fit {out} --out {out}-tree.json makes your tree; --practise 200 mends it"
        )
    output.result(
        {"episodes": len(kept), "n_transitions": steps, "path": str(out)},
        f"{len(kept)} episodes, {steps} transitions, in {out}",
    )


def _record_in_browser(
    output: Output,
    recorder: "Recorder",
    spec: EnvironmentSpec,
    out: Path,
    *,
    host: str,
    port: int | None,
) -> None:
    from eutree.cli._tree_making import PageTree
    from eutree.interaction.browser import record_in_browser
    from eutree.interaction.browser.gate import is_loopback
    from eutree.interaction.making import make

    def ready(server: "PageServer") -> None:
        if not is_loopback(host):
            output.say(
                f"warning: other machines can reach this page at {host}, unencrypted; whoever has "
                "the address below can record. An SSH tunnel to 127.0.0.1 is safer."
            )
        output.say(f"open {server.url}")
        if is_loopback(host):
            output.say(
                f"from another machine, first: ssh -L {server.port}:127.0.0.1:{server.port} "
                "THIS-MACHINE"
            )

    steps = (f"demos stats {out} --html demos.html", f"fit {out} --out expert.json",
             "show expert.json")  # fmt: skip
    record_in_browser(
        recorder,
        host=host,
        port=port,
        details={"commands": [f"eutree {step}" for step in steps]},
        maker=PageTree(out, spec, lambda: make(spec), seed=recorder.session.settings.seed),
        on_ready=ready,
    )
