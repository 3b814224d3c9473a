"""Does it help to label the observation that was on the screen when the key was pressed?

Run: PYTHONPATH=src:. python -m benchmarks.delay [--seeds 3] [--styles careful ...]

Simulated hands before the recording engine itself, on its own clock: they see the pictures that it
gives out, some time later, and hold or release Space. A tree is fitted to each folder of 15
episodes, as recorded and after ``shift_delay``, and plays 300 episodes.
"""

import argparse

import gymnasium
import numpy as np

import eutree
from eutree.data import Demonstrations, Episode
from eutree.data.timing import shift_delay
from eutree.envs import _dynamics as dynamics
from eutree.interaction.events import KeyDown, KeyUp, Seen
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.play import COUNTDOWN, PLAYING
from eutree.interaction.session import Session
from eutree.interaction.settings import SessionSettings

TICK = 1 / 60
LINES = (8.0, 18.0)  # where the danger of a crossing begins [m]
WAITING = 2.6  # how far before a line one waits [m]
EARLY = {"slows-early": 8.0, "over-careful": 5.0}  # nearer than this a disc stops one before that
STYLES = ("careful", "brisk", "tails", *EARLY)
LOOK_BACK = 6  # ticks after which what has moved is seen to have moved


def goes(
    style: str, position: float, across: list[float], heading: list[float], *, moves: bool
) -> bool:
    """Return whether somebody of a style wants to go, from what they see.

    Who slows early stops for one decision on the way to a line, so only while the agent ``moves``;
    who is over-careful, as long as a disc is near.
    """
    for line, y, towards in zip(LINES, across, heading, strict=True):
        on_the_way = line - 2.0 * WAITING <= position < line - WAITING
        if on_the_way and abs(y) < EARLY.get(style, 0.0) and (moves or style == "over-careful"):
            return False
        if not line - WAITING <= position < line:
            continue
        comes = y * towards < 0.0
        near = abs(y) < {"brisk": 6.5, "tails": 7.5}.get(style, 8.3)
        if style == "tails":
            near = abs(y) < 2.2 or (comes and near)
        if near:
            return False
    return True


class Hands:
    """Somebody before the engine, who sees what it shows, late."""

    def __init__(self, style: str, delay: float, seed: int) -> None:
        env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
        self.world, self.style, self.delay = env.unwrapped, style, delay
        blank = np.zeros((2, 2, 3), np.uint8)

        def look(share: float | None = None) -> np.ndarray:
            state = self.world.state if share is None else self.world._between(share)
            seen = dynamics.observe(self.world.parameters, state)
            self.shown = (float(seen[0]), seen[1:].tolist(), np.asarray(state.directions).tolist())
            return blank

        self.world.render = self.world.render_between = look
        settings = SessionSettings(target=1000, seed=seed, countdown=0.5)
        self.session, self.now, self.frame = Session(GuardedEnv(env), settings=settings), 0.0, 0

    def tick(self, *events) -> str:
        self.now += TICK
        tick = self.session.tick(self.now, [Seen(self.frame), *events])
        if tick.frame is not None:
            self.frame = tick.frame.number
        return tick.view.state

    def play(self) -> Episode:
        self.tick(KeyDown("enter"), KeyUp("enter"))
        past, held, state = [], False, COUNTDOWN
        while state in (COUNTDOWN, PLAYING):
            past.append((self.now, self.shown))
            seen = [shown for when, shown in past if when <= self.now - self.delay]
            moves = len(seen) > LOOK_BACK and seen[-1][0] > seen[-1 - LOOK_BACK][0]
            wants = bool(seen) and goes(self.style, *seen[-1], moves=moves)
            change = [(KeyDown if wants else KeyUp)("space", self.frame)] * (wants != held)
            held, state = wants, self.tick(*change)
        self.tick(KeyUp("space", self.frame))
        for _ in range(60):
            self.tick()
        return self.session.episodes[-1]

    def folder(self, episodes: int = 15) -> Demonstrations:
        played = tuple(self.play() for _ in range(episodes))
        env = self.session.env
        return Demonstrations(played, env.schema, env.spec, f"{self.style} {self.delay}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--styles", nargs="+", choices=STYLES, default=STYLES)
    arguments = parser.parse_args()
    seeds = range(arguments.seeds)
    print("| style | delay | own | as recorded | shifted | difference, mean and each |")
    print("|---|---|---|---|---|---|")
    for style in arguments.styles:
        for delay in (0.2, 0.35):
            rows = []
            for seed in seeds:
                demos = Hands(style, delay, seed).folder()
                own = np.mean([bool(e.is_success) for e in demos])
                trees = [eutree.fit_expert_tree(d) for d in (demos, shift_delay(demos))]
                played = [eutree.evaluate(t, "eutree/Evasion2-v0", episodes=300) for t in trees]
                rows.append([own, *(p.success_rate for p in played)])
            own, raw, shifted = np.mean(rows, axis=0)
            each = ", ".join(f"{100 * (row[2] - row[1]):+.0f}" for row in rows)
            gain = f"{100 * (shifted - raw):+.1f} ({each})"
            print(
                f"| {style} | {delay} s | {own:.0%} | {raw:.0%} | {shifted:.0%} | {gain} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
