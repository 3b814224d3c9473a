"""The button *Make my tree* of the recorder's page: fit, play, practise where it falls short."""

import shlex
from collections.abc import Callable
from contextlib import closing, suppress
from copy import copy
from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eutree.data import DemonstrationFolder, Demonstrations
from eutree.data.demonstrations import lessons
from eutree.display import counted
from eutree.errors import EutreeError, InvalidArgumentError
from eutree.evaluation import Evaluation, evaluate
from eutree.export import to_svg
from eutree.fitting.diagnosis import taking
from eutree.fitting.page_views import Way, beside_each_other, hurt_views, said_of, smaller, value
from eutree.fitting.report import FitReport, Person, result_in_words, verdict
from eutree.interaction import GuardedEnv, episode_seed
from eutree.policies import TreePolicy
from eutree.recording.scenes import Programme, Scene, missing, scenes
from eutree.recording.tree_making import FITTING, PLAYING, PRACTISING, READY, Show, TreeView

if TYPE_CHECKING:
    import gymnasium

    from eutree.training import Run

FITTED = 200  # episodes that judge the fit; practice begins with them too
PLAYED = 200  # episodes of the verdict, the same for every tree
BLOCK = 20  # of them at once, so that progress is seen
PRACTICE = 200  # episodes of learning after the first press; each further one doubles them
CURVE_EVERY = 10  # episodes of practice between two points of the curve
PER_POINT = 50  # episodes played for each point
STAGES = {
    "choosing": "Comparing trees by playing",
    "repairing": "Mending the best one",
    "judging": "Judging it",
}
TRIED, MISSING = 40, 1000  # episodes that find scenes not shown yet; their first seed
BETWEEN = 3  # smaller trees that are shown beside the practised one
ENOUGH = 0.97  # share of successes from which practice stops paying


class PageTree:
    """Makes the tree of a folder of demonstrations; a ``TreeMaker``.

    The tree is written beside the folder: ``demos-tree.json``, and ``demos-practised.json`` where
    practice made it better. ``make`` makes the environment where it plays and practises, without
    pictures, and ``seed`` is that of both; by the words ``imported`` the commands know it.
    """

    def __init__(
        self, folder: Path, make: "Callable[[], gymnasium.Env[Any, Any]]", *, seed: int = 0
    ) -> None:
        self._folder, self._make, self._seed = folder, make, seed
        self.imported: tuple[str, ...] = ()
        self._fitted: FitReport | None = None
        self._best: Way | None = None
        self._presses = 0
        self._ways: list[Way] = []
        self._without: PageTree | None = None  # as it was before something was cut

    @property
    def best(self) -> tuple[TreePolicy, Evaluation] | None:
        """The best tree so far, and the episodes that judged it; None before the first."""
        return None if self._best is None else (self._best.tree, self._best.played)

    def make(self, show: Show, stop: Callable[[], bool]) -> None:
        """Fit a tree to the demonstrations recorded so far, and let it play."""
        with suppress(_NobodyWaits):
            self._say(self._made(_Page(show, stop)), "", show)

    def _made(self, page: "_Page") -> Way:
        """Return the tree of all that is stored, chosen by playing and judged."""
        from eutree.fitting.fit import fit

        def progress(purpose: str, played: int, most: int) -> None:
            page.check()
            if played % BLOCK == 0:
                message = f"{STAGES.get(purpose, purpose)}: {played} of {most} episodes"
                page(TreeView(phase=FITTING, message=message, finished=played, of=most))

        page(TreeView(phase=FITTING, message="Fitting trees to what you showed"))
        with closing(self._make()) as env:
            fitted = fit(self._known(), env, episodes=FITTED, seed=self._seed, on_progress=progress)
        tree, path = fitted.policy, self._beside("tree")
        tree.save(path)
        made = Way("your tree", "Keep mine", tree, self._play(tree, page), path)
        self._fitted, self._best, self._presses, self._ways = fitted, made, 0, [made]
        return made

    def _known(self) -> Demonstrations:
        """Return what a tree is made of: all that is stored."""
        return Demonstrations.load(self._folder)

    def look(self, show: Show, stop: Callable[[], bool]) -> None:
        """Find by playing which seconds of the demonstrations cost the tree its success."""
        from eutree.fitting import find_hurting

        page = _Page(show, stop)
        with suppress(_NobodyWaits):
            best = self._best or self._made(page)
            place, drawn = DemonstrationFolder(self._folder), _drawn(best.tree)
            stored = place.read_all()  # once: another recorder may write beside
            known = Demonstrations(tuple(stored.values()), place.schema, place.environment)

            def progress(purpose: str, played: int, most: int) -> None:
                message = f"Looking for seconds that hurt, {purpose}: {played} of {most} episodes"
                page(TreeView(phase=FITTING, message=message, finished=played, of=most, **drawn))

            with closing(self._make()) as env:
                found = find_hurting(known, env, seed=self._seed, on_progress=progress)
            hurts = hurt_views(found, list(stored))
            show(replace(self._verdict(best, said_of(found)), hurts=hurts, was_searched=True))

    def make_without(self, show: Show, stop: Callable[[], bool]) -> None:
        """Make the tree of the steps that are left, and show it beside the one of all."""
        before = self._best
        if before is None:
            return
        self._without, left, note = copy(self), before, "Keep it so, or take it back?"
        with suppress(_NobodyWaits):
            try:
                left = self._made(_Page(show, stop))
                self._ways = [replace(before, name="with them", keep=""),
                              replace(left, name="without them", keep="")]  # fmt: skip
            except EutreeError as error:  # nothing may be left
                note = f"{error}. {note}"
            show(replace(self._verdict(left, note), asks=True))

    def settle(self, show: Show, *, undo: bool) -> None:
        """Keep the tree of the steps that are left, or the one before it."""
        before, self._without = self._without, None
        if before is None or self._best is None:
            raise InvalidArgumentError("there must be a change to settle, got none")
        if undo:
            vars(self).update(vars(before))
        else:
            self._ways = [self._best]
        self._best.tree.save(self._best.path)
        note = "Taken back: everything you showed counts." if undo else "What is left is kept."
        self._say(self._best, note, show)

    def practise(self, show: Show, stop: Callable[[], bool]) -> None:
        """Let the tree learn for a while, and keep the better one."""
        from eutree.fitting.playing import practise

        if self._best is None:
            self.make(show, stop)
        before, fitted, page = self._best, self._fitted, _Page(show, stop)
        if before is None or fitted is None:
            return
        known, episodes = Demonstrations.load(self._folder), PRACTICE * 2**self._presses
        self._presses += 1
        begun = TreeView(
            phase=PRACTISING,
            message="The tree practises by itself",
            of=episodes,
            **_scale(Person.of(known), before.played),
            **_drawn(before.tree),
        )
        with suppress(_NobodyWaits):
            with closing(self._make()) as env, closing(self._make()) as other:
                curve = _Curve(other, begun, show)
                learned = practise(
                    fitted.policy, known, fitted.plays, env,
                    episodes=episodes, seed=self._seed, on_progress=curve, stop=stop,
                )  # fmt: skip
            page.check()
            plays = [(self._play(one, page), one) for one in learned]
            played, tree = max(plays, key=lambda entry: value(entry[0]))
            best, reached = before, result_in_words(before.played)
            note = f"After {episodes} episodes of practice; before it {reached}."
            if value(played) > value(before.played):
                path = self._beside("practised")
                tree.save(path)
                self._best = best = Way("practised", "Keep the practised one", tree, played, path)
                self._ways = self._beside_practised(best, page)
            else:
                found = result_in_words(played)
                note = f"{episodes} episodes of practice found nothing better, only {found}."
            ready = replace(self._verdict(best, note), curve=curve.points, of=episodes)
            show(ready, self._programme(best, show))

    def missing(self) -> Scene | None:
        """Return a scene not shown yet, for want of which the tree of C4.5 fails."""
        from eutree.learners import fit_expert_tree

        known = Demonstrations.load(self._folder)
        tree, seed = fit_expert_tree(known), self._seed + MISSING + len(known)
        with closing(self._make()) as env:
            played = evaluate(tree, env, episodes=TRIED, seed=seed)
            if played.successes is None:
                return None
            seeds = [episode_seed(seed, k) for k in range(TRIED)]
            return missing(tree, seeds, played.successes.tolist(), GuardedEnv(env))

    def choose(self, way: int, show: Show) -> None:
        """Keep the tree of one of the ways that were shown; 0 is the person's own."""
        if not 1 <= way <= len(self._ways):
            raise InvalidArgumentError(f"way must be in 1..{len(self._ways)}, got {way}")
        self._best = chosen = self._ways[way - 1]
        chosen.tree.save(chosen.path)
        self._say(chosen, f"Kept: {chosen.name}.", show)

    def _beside_practised(self, practised: Way, page: "_Page") -> list[Way]:
        """Return the ways to show beside the practised tree.

        Between the tree that was fitted and the practised one lie smaller ones of the latter: the
        best of each size, those that do no worse than the fitted one.
        """
        tree, mine = practised.tree, self._ways[0]
        known = Demonstrations.load(self._folder).with_history(tree.history)
        message = "Looking for smaller trees between yours and the practised one"
        page(TreeView(phase=PRACTISING, message=message, **_drawn(tree)))
        with closing(self._make()) as env:
            found = smaller(tree, known.observations, env, seed=self._seed)
        enough = [one.policy for one in found if value(one) >= value(mine.played)]
        between = [
            Way(
                f"practised, {counted(policy.n_leaves, 'leaf')}",
                f"Keep the one of {policy.n_leaves}",
                policy,
                self._play(policy, page),
                self._beside(f"practised-{policy.n_leaves}"),
            )
            for policy in enough[:: max(len(enough) // BETWEEN, 1)][:BETWEEN]
        ]
        return [mine, *reversed(between), practised]

    def driving(self, tree: TreePolicy, show: Show) -> Programme:
        """Return how the person may correct a tree: it is fitted again after each episode."""
        return Programme(tree, refit=lambda: self._refitted(tree, show))

    def _refitted(self, tree: TreePolicy, show: Show) -> TreePolicy:
        """Show and return the tree of all that is stored by now; the one given, if nothing is."""
        from eutree.learners import fit_expert_tree

        known = Demonstrations.load(self._folder)
        driven = sum(episode.by_hand is not None for episode in known)
        own, message = len(known) - driven, "Nothing is left to imitate: the given tree drives on"
        if lessons(known)[1].size:
            tree = fit_expert_tree(known)
            message = f"Fitted to {own} episodes of yours and {driven} that a tree drove"
        path = self._beside("driving")
        tree.save(path)
        show(
            TreeView(
                phase=READY,
                message=message,
                note="Make it again to have it chosen by playing, and judged.",
                commands=self._commands(path, tree),
                **_drawn(tree),
            )
        )
        return tree

    def _programme(self, best: Way, show: Show) -> Programme:
        """Return the episodes of a tree to watch: those that judged it, worst first."""
        played = best.played
        seeds = [episode_seed(self._seed + k // BLOCK, k % BLOCK) for k in range(played.episodes)]
        known = None if played.successes is None else played.successes.tolist()
        with closing(self._make()) as env:
            watched = scenes(best.tree, seeds, played.returns, known, GuardedEnv(env))
            return replace(watched, refit=self.driving(best.tree, show).refit)

    def _play(self, tree: TreePolicy, page: "_Page") -> Evaluation:
        """Let the tree play, the same episodes for every tree."""
        parts, drawn = list[Evaluation](), _drawn(tree)
        with closing(self._make()) as env:
            for block in range(PLAYED // BLOCK):
                count = block * BLOCK
                message = f"The tree plays: {count} of {PLAYED} episodes"
                page(TreeView(phase=PLAYING, message=message, finished=count, of=PLAYED, **drawn))
                parts.append(evaluate(tree, env, episodes=BLOCK, seed=self._seed + block))
        return Evaluation.join(parts)

    def _say(self, best: Way, note: str, show: Show) -> None:
        """Show the verdict on a tree, and let it drive."""
        show(self._verdict(best, note), self._programme(best, show))

    def _verdict(self, best: Way, note: str) -> TreeView:
        tree, played, known = best.tree, best.played, Demonstrations.load(self._folder)
        person = Person.of(known)
        found = verdict(person.whole, played)
        may_gain = found.is_worse or played.successes is None or value(played) < ENOUGH
        parts = [note, "Practice may make it better." if may_gain else ""]
        if tree.n_leaves == 1:
            parts.append(f"It has a single leaf: it {taking(tree, 0)}.")
        elif found.is_worse and self._fitted is not None and tree is self._fitted.policy:
            parts += self._fitted.warnings
        with closing(self._make()) as env:
            beside = beside_each_other(self._ways, tree, known, env, seed=self._seed)
        you, it = (result_in_words(side, found.measure) for side in (person.whole, played))
        return TreeView(
            phase=READY,
            message=f"you {you}; this tree {it}: {found.word}",
            note=" ".join(filter(None, parts)),
            verdict=found.word,
            may_gain=may_gain,
            commands=self._commands(best.path, tree),
            **beside,
            **_scale(person, played),
            **_drawn(tree),
        )

    def _beside(self, name: str) -> Path:
        """Return the file of a tree beside the folder."""
        return self._folder.with_name(f"{self._folder.name}-{name}.json")

    def _commands(self, path: Path, tree: TreePolicy) -> tuple[str, ...]:
        """Return the commands that go on from the tree on the page, such as ``eutree learn``."""
        history = ("--history", str(tree.history)) if tree.history else ()
        run, source = path.with_name("run"), path.with_suffix(".c")
        lines: tuple[tuple[object, ...], ...] = (
            ("show", path),
            ("evaluate", path, "--episodes", 1000, *self.imported),
            ("learn", "--demos", self._folder, "--expert", path, *history, "--out", run,
             *self.imported),
            ("export", path, "--format", "c", "--out", source),
        )  # fmt: skip
        return tuple(shlex.join(["eutree", *map(str, line)]) for line in lines)


class _NobodyWaits(Exception):  # noqa: N818 - no error: the person has left
    """Ends work for which nobody waits."""


@dataclass(frozen=True)
class _Page:
    """Shows views as long as anybody waits for them, else raises ``_NobodyWaits``."""

    show: Show
    stop: Callable[[], bool]

    def __call__(self, view: TreeView) -> None:
        self.check()
        self.show(view)

    def check(self) -> None:
        if self.stop():
            raise _NobodyWaits


class _Curve:
    """The results of the practising tree, shown after each episode."""

    def __init__(self, env: "gymnasium.Env[Any, Any]", view: TreeView, show: Show) -> None:
        self._env, self._view, self._show = env, view, show
        self._finished = 0
        self.points: tuple[tuple[int, float], ...] = ()
        show(view)

    def __call__(self, run: "Run") -> None:
        """Count finished episodes; after every few of them let the present policy play."""
        if run.episode == self._finished:
            return  # it was evaluated
        self._finished = run.episode
        if self._finished % CURVE_EVERY == 0:
            played = evaluate(run.policy(), self._env, episodes=PER_POINT, seed=PLAYED)
            self.points = (*self.points, (self._finished, value(played)))
        message = f"The tree practises: {self._finished} of {self._view.of} episodes"
        self._show(replace(self._view, message=message, finished=self._finished, curve=self.points))


def _scale(person: Person, played: Evaluation) -> dict[str, Any]:
    """Return the view's fields on the curve's scale: the person is on it if it is theirs too."""
    is_share = played.success_rate is not None
    yours = person.success_rate if is_share else person.mean_return
    return {"is_share": is_share, "yours": None if yours is None or isnan(yours) else yours}


def _drawn(tree: TreePolicy) -> dict[str, Any]:
    return {"svg": to_svg(tree), "rules": str(tree), "n_leaves": tree.n_leaves}
