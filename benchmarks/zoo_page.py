"""Make the page of the zoo: a card for each tree, at play, proven or not, and as a program.

Run: python -m benchmarks.zoo_page [--docs FOLDER] [--tasks TASK ...]

With ``--tasks`` the cards of other tasks stay as they are.

A tree is drawn at play in its first fresh episode, and written as a Python program of one line that
decides like it, ``play(x)``, after the protocol of Kohler and others (2025): its bytes, and the
time of a decision. Times are of this machine, so beside them stands a thing that was timed in the
same seconds: a forward pass in numpy of a network with two layers of 64, for the same observation.
Each program is a file of ``docs/static/play``; what ``eutree prove`` answers stands in the card.
"""

import argparse
import json
import re
import subprocess
import sys
import timeit
from collections.abc import Callable, Iterator
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from PIL import Image

import eutree
from eutree import zoo
from eutree.interaction.making import make
from eutree.trees.text import derived_features

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PLAY = "static/play"  # folder of the programs
BEGIN = "## The trees\n"  # what follows is made here
SHOWN = 8  # leaves of the largest program that stands on the page itself
EPISODE = 9_000_000  # seed of the episode that is drawn
WIDTH, FRAMES, FRAME_MS, COLOURS = 240, 60, 100, 64
DECISIONS, REPEATS, HIDDEN = 2000, 7, 64
# How a derived feature is computed where it is asked for; a formula with more has no such program.
OPERATIONS = {
    "+": "({}+{})".format, "-": "({}-{})".format, "*": "({}*{})".format, "negative": "(-{})".format,
    "min": "min({},{})".format, "max": "max({},{})".format, "abs": "abs({})".format, "number": repr,
}  # fmt: skip


def play_program(policy: eutree.TreePolicy) -> str:
    """Return a program of one line that decides like a tree; NaN fails every test here too."""
    tree, measured = policy.tree, policy.derivation.n_measured

    names = {feature: f"x[{feature}]" for feature in range(measured)}
    for j in derived_features(tree, policy.schema):
        formula = policy.derivation.formulas[j - measured]
        names[j] = formula.compute(names, no_last, OPERATIONS)

    def written(node: int) -> str:
        if tree.leaf[node] != tree.NO_LEAF:
            return str(int(policy.actions[tree.leaf[node]]))
        yes, no = written(int(tree.left[node])), written(int(tree.right[node]))
        yes = f"({yes})" if "if" in yes else yes
        test = f"{names[tree.feature[node]]}<={float(tree.threshold[node])!r}"
        return f"{yes} if {test} else {no}"

    return f"def play(x):return {written(0)}\n"


def no_last(feature: int) -> NoReturn:
    raise SystemExit(f"play(x) sees one step: it cannot have the last value of feature {feature}")


def compiled(program: str) -> Callable[[Any], int]:
    names: dict[str, Any] = {}
    exec(program, names)
    return names["play"]  # type: ignore[no-any-return]


def seen_by(policy: eutree.TreePolicy, env: Any) -> tuple[np.ndarray, list[Any]]:
    """Return what a tree sees in one episode, and its pictures, if the task draws any."""

    def seen() -> list[Any]:
        return [env.render()] if env.render_mode else []

    observation, _ = env.reset(seed=EPISODE)
    rows, pictures, over = [], seen(), False
    while not over:
        rows.append(np.asarray(observation, dtype=np.float64).ravel())
        action = policy.predict(observation)[0]
        observation, _, terminated, truncated, _ = env.step(action)
        pictures += seen()
        over = terminated or truncated
    return np.array(rows), pictures


def draw(pictures: list[Any], path: Path) -> None:
    """Write an animation of an episode: few pictures, few colours."""
    chosen = np.linspace(0, len(pictures) - 1, min(len(pictures), FRAMES)).astype(int)
    small = []
    for index in chosen:
        whole = Image.fromarray(pictures[index])
        size = (WIDTH, round(WIDTH * whole.height / whole.width))
        small.append(whole.resize(size, Image.Resampling.LANCZOS))
    palette = small[len(small) // 2].quantize(COLOURS)
    frames = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in small]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, optimize=True
    )


def times(program: str, rows: np.ndarray, n_actions: int) -> tuple[float, float]:
    """Return nanoseconds of a decision, and those of the network's, the least of some repeats."""
    play = compiled(program)
    rng = np.random.default_rng(0)
    sizes = (rows.shape[1], HIDDEN, HIDDEN, n_actions)
    weights = [rng.normal(size=pair) for pair in pairwise(sizes)]
    first, second, last = weights

    def network(x: np.ndarray) -> int:
        hidden = np.maximum(np.maximum(x @ first, 0.0) @ second, 0.0)
        return int((hidden @ last).argmax())

    chosen = rows[np.linspace(0, len(rows) - 1, DECISIONS).astype(int)]
    lists = chosen.tolist()

    def least(decide: Callable[[Any], int], inputs: Any) -> float:
        run = timeit.Timer(lambda: [decide(one) for one in inputs]).repeat(REPEATS, 1)
        return min(run) / len(inputs) * 1e9

    return least(play, lists), least(network, chosen)


def proof_of(card: zoo.Card) -> str:
    """Return what ``eutree prove`` answers of a tree."""
    more = ["--import", card.module] if card.module else []
    line = [sys.executable, "-m", "eutree", "prove", f"zoo:{card.name}", "--json", *more]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    if not done.stdout:
        return f"refused: {done.stderr.strip().removeprefix('error: ')}"
    found = json.loads(done.stdout)
    return f"{found['verdict']} ({found['kind']}): {found['sentence']}"


def write_program(card: zoo.Card, docs: Path) -> str:
    """Write the program of a tree to its file, and return it."""
    path, program = docs / PLAY / f"{Path(card.file).stem}.py", play_program(zoo.load(card.name))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(program)
    return program


def card_lines(card: zoo.Card, docs: Path) -> Iterator[str]:
    """Yield the card of a tree; its picture is drawn, and its program written, on the way."""
    if card.module:
        import_module(card.module)
    policy = zoo.load(card.name)
    assert policy.environment is not None
    drawn = "rgb_array" in make(policy.environment).metadata["render_modes"]
    rows, pictures = seen_by(
        policy, make(policy.environment, render_mode="rgb_array" if drawn else None)
    )
    stem = Path(card.file).stem
    program = write_program(card, docs)
    decision, network = times(program, rows, policy.schema.n_actions)
    low, high = card.interval
    yield f"### {card.name}\n"
    picture = f"images/zoo-{stem}.gif"
    if drawn:
        (docs / "images").mkdir(exist_ok=True)
        draw(pictures, docs / picture)
        yield f"![{card.task}, an episode of the tree with {card.leaves} leaves]({picture})\n"
    yield "| | |\n|---|---|"
    yield f"| leaves | {card.leaves} |"
    yield f"| return of {card.episodes:,} fresh episodes | {card.mean_return} [{low}, {high}] |"
    yield f"| worst of them | {card.worst} |"
    asked = {policy.schema.features[feature] for feature in policy.tree.feature if feature >= 0}
    for derived in policy.schema.derived:
        if derived in asked:
            yield f"| derived | `{derived.name} = {derived.formula}` |"
    if card.success is not None:
        yield f"| success | {card.success:.1%} |"
    yield f"| counted steps | {card.steps:,}, with seed {card.seed} |"
    if card.module:
        yield f"| its task | an example of the repository: `--import {card.module}` |"
    if card.extra:
        yield f"| its task needs | `{card.extra}`, which `eutree[envs]` brings |"
    yield f"| learned by | `{card.command}`, at {card.commit} |"
    yield f"| `eutree prove` | {proof_of(card)} |"
    yield f"| `play(x)` | [{len(program.encode())} bytes]({PLAY}/{stem}.py) |"
    share = f"1/{network / decision:.0f}"
    yield f"| a decision | {decision:.0f} ns, {share} of the network's |\n"
    if card.leaves <= SHOWN:
        yield f"```text\n{program}```\n"


def card_on(page: str, name: str) -> str:
    """Return the card of a tree as it stands on a page."""
    found = re.search(rf"^### {re.escape(name)}\n.*?(?=^### |\Z)", page, re.DOTALL | re.MULTILINE)
    if found is None:
        raise SystemExit(f"the page has no card of {name}: name its task, too")
    return found[0].rstrip() + "\n"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--docs", type=Path, default=DOCS)
    parser.add_argument("--tasks", nargs="+", default=zoo.tasks())
    arguments = parser.parse_args()
    head, _, cards = (DOCS / "zoo.md").read_text().partition(BEGIN)
    lines = [head.rstrip(), "", BEGIN, NOTE]
    for card in zoo.cards():
        if card.task in arguments.tasks:
            lines += card_lines(card, arguments.docs)
            print(card.name, flush=True)
        else:
            lines.append(card_on(cards, card.name))
    (arguments.docs / "zoo.md").write_text("\n".join(lines).rstrip() + "\n")


NOTE = """\
Made by `python -m benchmarks.zoo_page`. Each tree is shown in an episode that chose nothing, and
as a Python program of one line that decides like it, `play(x)`, a file each: its bytes, and the
time of a decision beside that of a network with two layers of 64 in numpy, timed in the same
seconds on one machine (the protocol of Kohler and others, 2025). What is derived is computed where
it is asked for. `eutree prove` answers of the property that the task's plant has of its own; where
no plant is known it is statistical.
"""


if __name__ == "__main__":
    main()
