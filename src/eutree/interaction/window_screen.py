"""What the recorder's window looks like: the picture, words below it, keys and episodes beside it.

Nothing covers the picture but a small pill in its corner and a thin line at its lower edge.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from eutree.interaction.events import EpisodeView, Frame, Tick, View
from eutree.interaction.play import (
    ASKED,
    COUNTDOWN,
    FINISHED,
    OPENING,
    PAUSED,
    PLAYING,
    REVIEW,
)

SIZE = (1100, 740)
FREE = 0.92  # of the desktop; the rest is for its bars and the window's title
STAGE = (20, 64, 740, 470)  # left, top, width, height of the picture's place
CARD_TOP = 544  # of the words below it
LINE_WIDTH = 90  # characters of a line of the card
MOST_LINES = 7  # of the card below its title
SHORTEST_BEAT = 0.15  # seconds between decisions; below that a line would only flicker
SIDE = 784  # left edge of the column beside it
SIDE_WIDTH = 296

GROUND, PANEL, INK = (244, 242, 236), (255, 254, 251), (34, 33, 29)
SOFT, LINE, ACCENT = (95, 92, 83), (220, 216, 204), (31, 95, 191)
GOOD, BAD = (26, 115, 69), (179, 55, 42)

GLYPHS = {"left": "Left", "right": "Right", "up": "Up", "down": "Down", "escape": "Esc",
          "delete": "Del", "space": "Space", "enter": "Enter", "backspace": "Back"}  # fmt: skip
CONTROLS = {
    "pause": "pause, go on",
    "end": "end the episode",
    "redo": "same start again",
    "discard": "discard",
    "finish": "finish",
    "slower": "slower",
    "faster": "faster",
    "mode": "other mode",
    "wait": "one step without a key",
}
ENDINGS = {
    "goal": "Goal reached",
    "collision": "Collision",
    "time limit": "Time is over",
    "stopped": "Stopped by you",
    "terminated": "The episode is over",
    "truncated": "Time is over",
}
FACES = "dejavusans,notosans,liberationsans,segoeui,helveticaneue,arial"


class Screen:
    """Draws a session's view into the window."""

    def __init__(self) -> None:
        import pygame

        self._pygame: Any = pygame
        pygame.font.init()
        self._window: Any = pygame.display.set_mode(fitting(pygame.display.get_desktop_sizes()[0]))
        # What is drawn has always the same size; a smaller window shows it scaled down.
        small = self._window.get_size() != SIZE
        self._surface: Any = pygame.Surface(SIZE) if small else self._window
        pygame.display.set_caption("eutree recorder")
        self._fonts: dict[tuple[int, bool], Any] = {}
        self._faces: dict[bool, str | None] = {}
        self._picture: Any = None
        self._shown: tuple[View, int | None, int] | None = None
        self._beat: tuple[tuple[int, float, float], float] = ((-1, 0.0, 0.0), 0.0)
        self.chosen: int | None = None  # place in the list of the episode that can be changed
        self._rows: list[tuple[Any, int]] = []  # where the episodes of the list are drawn

    def episode_at(self, position: tuple[int, int]) -> int | None:
        """Return the place in the list of the episode drawn at a point of the window."""
        window = self._window.get_size()
        point = [at * size / shown for at, size, shown in zip(position, SIZE, window, strict=True)]
        return next((row for box, row in self._rows if box.collidepoint(point)), None)

    def draw(self, tick: Tick) -> None:
        """Draw a view if anything has changed since the last one."""
        if tick.view.state in (PLAYING, COUNTDOWN):
            self.chosen = None
        shown = (tick.view, self.chosen, self._beat_width(tick.view))
        if tick.frame is None and shown == self._shown:
            return
        if tick.frame is not None:
            self._picture = self._scaled(tick.frame)
        self._shown = shown
        self._surface.fill(GROUND)
        self._header(tick.view)
        self._stage(tick.view)
        self._column(tick.view)
        if self._surface is not self._window:
            size = self._window.get_size()
            self._pygame.transform.smoothscale(self._surface, size, self._window)
        self._pygame.display.flip()

    def _scaled(self, frame: Frame) -> Any:
        """Return the picture, as large as its place allows."""
        pygame = self._pygame
        image = pygame.surfarray.make_surface(np.swapaxes(frame.pixels, 0, 1))
        scale = min(STAGE[2] / image.get_width(), STAGE[3] / image.get_height())
        size = (round(image.get_width() * scale), round(image.get_height() * scale))
        return pygame.transform.smoothscale(image, size)

    def _header(self, view: View) -> None:
        width = self._text("Recorder", (20, 20), size=22, bold=True)
        self._text(view.environment, (20 + width + 12, 24), color=SOFT)
        self._text(f"{view.saved} of {view.target}", (SIDE, 22), bold=True, size=18)
        bar = self._pygame.Rect(SIDE + 110, 30, SIDE_WIDTH - 110, 8)
        self._box(bar, LINE, radius=4)
        bar.width = round(bar.width * min(view.saved / view.target, 1.0))
        self._box(bar, GOOD, radius=4)

    def _beat_width(self, view: View) -> int:
        """Return how much of the thin line is filled; full when the next decision falls."""
        runs = view.state == PLAYING and not (view.awaits_key or view.turn_based)
        if not runs or view.interval < SHORTEST_BEAT:
            return 0
        now = time.monotonic()
        which = (view.step, view.beat, view.interval)
        if self._beat[0] != which:
            self._beat = (which, now)
        share = view.beat + (now - self._beat[1]) / view.interval
        return round(STAGE[2] * min(share, 1.0))

    def _stage(self, view: View) -> None:
        pygame = self._pygame
        place = pygame.Rect(STAGE)
        self._box(place, PANEL, radius=12)
        if self._picture is not None:
            self._surface.blit(self._picture, self._picture.get_rect(center=place.center))
        width = self._beat_width(view)
        if width:
            self._box(pygame.Rect(place.left, place.bottom - 4, width, 4), ACCENT, radius=2)
        if view.state in (PLAYING, COUNTDOWN):
            self._pill(view, place)
        self._card(view)
        status = f"{view.speed:g} x   {mode_name(view)}   step {view.step}"
        self._text(status, (SIDE, SIZE[1] - 28), color=SOFT, size=13)

    def _pill(self, view: View, place: Any) -> None:
        """Say in the picture's corner which action is under way, and which one comes."""
        text, is_idle = pill(view)
        if not text:
            return
        color, ink = (PANEL, INK) if is_idle else (ACCENT, PANEL)
        image = self._font(16, bold=True).render(text, True, ink)
        box = image.get_rect(topleft=(place.left + 24, place.top + 15)).inflate(24, 10)
        self._box(box, color, radius=box.height // 2)
        self._pygame.draw.rect(self._surface, LINE, box, 1, border_radius=box.height // 2)
        self._surface.blit(image, image.get_rect(center=box.center))

    def _card(self, view: View) -> None:
        """Write below the picture what to do now; the count stands before it."""
        title, lines, color = words(view)
        left, top = STAGE[0] + 4, CARD_TOP
        if view.state == COUNTDOWN and view.countdown:
            number = self._font(62, bold=True).render(str(view.countdown), True, ACCENT)
            self._surface.blit(number, (left, top))
            left += 66
        self._text(title, (left, top), size=22, bold=True, color=color)
        parts = [part for line in lines for part in wrap(line, LINE_WIDTH)]
        if len(parts) > MOST_LINES:  # what to press next stands in the last line
            parts = [*parts[: MOST_LINES - 1], parts[-1]]
        for place, part in enumerate(parts):
            self._text(part, (left, top + 32 + 21 * place))

    def _column(self, view: View) -> None:
        top = self._panel("Keys", 64, key_lines(view))
        if view.numbers is not None:
            top = self._panel("What the agent senses", top, [(n, v, INK) for n, v in view.numbers])
        self._episodes(view, top)

    def _episodes(self, view: View, top: int) -> None:
        """Draw the list of episodes, the last first, and the marked one in any case."""
        count, room = len(view.episodes), max((SIZE[1] - top - 104) // 22, 1)
        first = max(0, count - room)
        if self.chosen is not None:
            first = min(first, self.chosen)
        last = min(first + room, count)
        shown = view.episodes[first:last]
        self._panel("Episodes", top, episode_lines(shown))
        self._rows = []
        for place, row in enumerate(range(last - 1, first - 1, -1)):
            box = self._pygame.Rect(SIDE + 8, top + 32 + 22 * place, SIDE_WIDTH - 16, 22)
            self._rows.append((box, row))
            if row == self.chosen:
                self._pygame.draw.rect(self._surface, ACCENT, box, 2, border_radius=6)
        if shown and view.state not in (PLAYING, COUNTDOWN):
            hint = "Tab: choose     K: discard, keep"
            self._text(hint, (SIDE + 16, top + 52 + 22 * len(shown)), color=SOFT, size=13)

    def _panel(self, title: str, top: int, lines: list[tuple[str, str, Any]]) -> int:
        height = 46 + 22 * len(lines)
        self._box(self._pygame.Rect(SIDE, top, SIDE_WIDTH, height), PANEL, radius=12)
        self._text(title, (SIDE + 16, top + 10), color=SOFT, size=14, bold=True)
        for place, (left, right, color) in enumerate(lines):
            y = top + 34 + 22 * place
            self._text(left, (SIDE + 16, y), color=color)
            image = self._font(15).render(right, True, color)
            self._surface.blit(image, image.get_rect(topright=(SIDE + SIDE_WIDTH - 16, y)))
        return top + height + 12

    def _box(self, box: Any, color: tuple[int, int, int], *, radius: int) -> None:
        self._pygame.draw.rect(self._surface, color, box, border_radius=radius)

    def _text(
        self,
        text: str,
        place: tuple[int, int],
        *,
        color: tuple[int, int, int] = INK,
        size: int = 15,
        bold: bool = False,
    ) -> int:
        image = self._font(size, bold=bold).render(text, True, color)
        self._surface.blit(image, place)
        return int(image.get_width())

    def _face(self, bold: bool) -> str | None:
        """Return the file of a face of this system; None for pygame's own."""
        if bold not in self._faces:
            self._faces[bold] = self._pygame.font.match_font(FACES, bold=bold)
        return self._faces[bold]

    def _font(self, size: int, *, bold: bool = False) -> Any:
        if (size, bold) not in self._fonts:
            self._fonts[(size, bold)] = self._pygame.font.Font(self._face(bold), round(size * 1.2))
        return self._fonts[(size, bold)]


def fitting(desktop: tuple[int, int]) -> tuple[int, int]:
    """Return the window's size on a desktop: smaller where it would be cut off."""
    share = min(1.0, *(FREE * room / size for room, size in zip(desktop, SIZE, strict=True)))
    return round(SIZE[0] * share), round(SIZE[1] * share)


def mode_name(view: View) -> str:
    """Return how keys act at present."""
    if view.turn_based:
        return "one step for each key"
    return "a key switches on and off" if view.toggle else "acting while a key is held"


def key_lines(view: View) -> list[tuple[str, str, Any]]:
    """Return the lines of the list of keys."""
    lines: list[tuple[str, str, Any]] = []
    for number, action in enumerate(view.actions):
        keys = [*map(key_text, action.keys), *(["no key"] if action.is_idle else [])]
        is_on = view.state == PLAYING and number == view.action
        lines.append((action.name, ", ".join(keys), ACCENT if is_on else INK))
    for name, meaning in CONTROLS.items():
        if name in view.controls and (name != "wait" or view.turn_based):
            lines.append((meaning, key_text(view.controls[name]), SOFT))
    return lines


def episode_lines(episodes: list[EpisodeView]) -> list[tuple[str, str, Any]]:
    """Return the lines of the list of episodes, the last first."""
    if not episodes:
        return [("Nothing recorded yet.", "", SOFT)]
    lines = []
    for row in reversed(episodes):
        color: Callable[[EpisodeView], Any] = result_color
        note = "" if row.kept else f", {row.comment or 'discarded'}"
        left, right = f"{row.number}  {row.result}{note}", f"{row.length} steps, {row.total:g}"
        lines.append((left, right, color(row) if row.kept else SOFT))
    return lines


def result_color(row: EpisodeView) -> tuple[int, int, int]:
    """Return green for a success, red for a failure."""
    return INK if row.success is None else GOOD if row.success else BAD


def pill(view: View) -> tuple[str, bool]:
    """Return what is under way and, after an arrow, what comes; and whether nothing is done.

    Where the episode begins with the first key, nothing is under way before it.
    """
    acting, coming = view.actions[view.action], view.actions[view.coming]
    counts = view.state == COUNTDOWN and not view.step
    begins = counts and not any(action.is_idle for action in view.actions)
    if view.awaits_key or (begins and not view.held):
        return "", True
    if counts:
        return coming.name, coming.is_idle
    changes = coming is not acting and view.state == PLAYING
    return f"{acting.name} \u2192 {coming.name}" if changes else acting.name, coming.is_idle


def key_sentence(view: View) -> str:
    """Return which key does what, and what happens without one."""
    verb = "Press" if view.turn_based else "Switch with" if view.toggle else "Hold"
    parts = [
        f"{' or '.join(map(key_text, action.keys))}: {action.name}"
        for action in view.actions
        if action.keys
    ]
    idle = next((action.name for action in view.actions if action.is_idle), None)
    rest = f"; no key: {idle}" if idle is not None else "; without a key the last one goes on"
    return f"{verb} {', '.join(parts)}{'' if view.turn_based else rest}."


def words(view: View) -> tuple[str, list[str], Any]:
    """Return title, lines and the title's color of the card below the picture."""
    keys = {name: key_text(key) for name, key in view.controls.items()}
    saved = f"{view.saved} of {view.target} saved"
    enough = view.saved >= view.target
    finish = f"{keys.get('finish', '')}: finish"
    early = ended_early(view.episodes)
    if view.state == OPENING:
        task = view.task or "Act as you would have the machine act."
        slow = " It is shown slowly at first, because it is quick." if view.is_slowed else ""
        lines = [task, key_sentence(view) + slow, *early, f"Enter: start     {finish}"]
        return "Show how it is done", lines, INK
    if view.state == COUNTDOWN:
        return "Get ready", [_when_it_begins(view), key_sentence(view)], INK
    if view.state == PLAYING:
        title = "Press a key to begin" if view.awaits_key else "Your turn"
        return title, [key_sentence(view)], INK
    if view.state == ASKED:
        within = f"Please answer within {view.countdown} s; else learning goes on without you."
        answer = f"Enter: show it     {keys.get('finish', '')}: not now, hand back"
        return "How would you go on?", [view.message, within, answer], INK
    if view.state == PAUSED:
        return "Paused", [view.message, f"Enter: go on     {keys.get('end', '')}: end here"], INK
    if view.state == REVIEW:
        last = view.episodes[-1] if view.episodes else None
        title = ENDINGS.get(last.result, last.result) if last else "Nothing was recorded"
        if last is not None and not last.kept:
            title = f"{title}, {last.comment or 'discarded'}"
        following = "Enter: finish" if enough else f"Enter: next     {finish}"
        redo = f"{keys.get('redo', '')}: same start again     {keys.get('discard', '')}: discard"
        failed = last is not None and last.kept and last.success is False
        stays = ["It counts: failures may stay. Discard it if your hand slipped."] if failed else []
        color = INK if last is None or not last.kept else result_color(last)
        return title, [saved, *stays, *early, f"{following}     {redo}"], color
    if view.state == FINISHED:
        return saved, ["Everything is stored. Any key closes the window."], GOOD if enough else INK
    return "The recording has ended", [view.message, "What was recorded is stored."], BAD


def _when_it_begins(view: View) -> str:
    if any(action.is_idle for action in view.actions):
        return "Hold the key while it counts: what you hold counts from the first decision on."
    return "The episode begins with your first key."


def ended_early(episodes: list[EpisodeView]) -> list[str]:
    """Return a line on the kept episodes that a person or a crash ended, if there are any."""
    early = [row for row in episodes if row.kept and row.result in ("stopped", "interrupted")]
    return [f"{len(early)} of them ended early and count like the others."] if early else []


def key_text(key: str) -> str:
    """Return a key's name for people."""
    return (
        " + ".join(GLYPHS.get(part, part.upper()) for part in key.split("+")) if key != "+" else key
    )


def wrap(text: str, width: int) -> list[str]:
    """Return the text in lines of at most about ``width`` characters."""
    lines = [""]
    for word in text.split(" "):
        if len(lines[-1]) + len(word) > width:
            lines.append("")
        lines[-1] += ("" if not lines[-1] else " ") + word
    return [line for line in lines if line.strip()]
