"""The button *Make my tree* of the recorder's page: fit, play, practise where it falls short."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    import gymnasium

    from eutree.data import Demonstrations
    from eutree.evaluation import Evaluation
    from eutree.fitting import FitReport
    from eutree.interaction.tree_making import Show, TreeView
    from eutree.policies import TreePolicy

FITTED = 200  # episodes that judge the fit; practice begins with them too
PLAYED = 100  # episodes of the verdict, the same for every tree
BLOCK = 20  # of them at once, so that progress is seen
PRACTICE = 200  # episodes of learning after the first press; each further one doubles them
CURVE_EVERY = 10  # episodes of practice between two points of the curve
PER_POINT = 50  # episodes played for each point
WITHIN = 0.03  # a share of successes this much lower is as good; practice stops paying there


@dataclass(frozen=True)
class Result:
    """What somebody reached.

    Attributes:
        episodes: How many were played.
        successes: How many of them succeeded; None where the environment does not say.
        mean_return: Their mean undiscounted return.
        spread: Standard error of the mean return.
    """

    episodes: int
    successes: int | None
    mean_return: float
    spread: float

    @property
    def value(self) -> float:
        """The share of successes where it is known, else the mean return."""
        return self.mean_return if self.successes is None else self.successes / self.episodes

    def __str__(self) -> str:
        """Return it as a person says it: ``13 of 15``."""
        if self.successes is None:
            return f"{self.mean_return:.1f} on average"
        return f"{self.successes} of {self.episodes}"

    def falls_short_of(self, other: "Result") -> bool:
        """Return whether this is worse than ``other``, beyond what is as good."""
        if self.successes is not None and other.successes is not None:
            return self.value < other.value - WITHIN
        return self.mean_return < other.mean_return - float(np.hypot(self.spread, other.spread))


def result_of_person(demonstrations: "Demonstrations") -> Result:
    """Return what the kept episodes reached; one that was ended early is no success."""
    returns = np.array([episode.undiscounted_return for episode in demonstrations], dtype=float)
    known = [e.is_success for e in demonstrations if e.is_success is not None]
    return _result(returns, sum(known) if known else None)


def result_of_tree(evaluation: "Evaluation") -> Result:
    """Return what an evaluated tree reached."""
    successes = evaluation.successes
    return _result(evaluation.returns, None if successes is None else int(successes.sum()))


def _result(returns: "np.ndarray[Any, Any]", successes: int | None) -> Result:
    count = len(returns)
    spread = float(returns.std(ddof=1) / np.sqrt(count)) if count > 1 else 0.0
    return Result(count, successes, float(returns.mean()), spread)


class PageTree:
    """Makes the tree of a folder of demonstrations; a ``TreeMaker``.

    The tree is written beside the folder: ``demos-tree.json``, and ``demos-practised.json`` where
    practice made it better.

    Args:
        folder: The demonstrations.
        environment: Where the tree plays and practises.
        make: Makes that environment, without pictures.
        seed: Seed of the games and of the practice.
    """

    def __init__(
        self,
        folder: Path,
        environment: EnvironmentSpec,
        make: "Callable[[], gymnasium.Env[Any, Any]]",
        *,
        seed: int = 0,
    ) -> None:
        self._folder, self._environment, self._make, self._seed = folder, environment, make, seed
        self._fitted: FitReport | None = None
        self._best: tuple[TreePolicy, Result, Path] | None = None
        self._presses = 0

    def make(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Fit a tree to the demonstrations recorded so far, and let it play."""
        from eutree.data import Demonstrations
        from eutree.interaction.tree_making import FITTING, TreeView

        show(TreeView(phase=FITTING, message="Fitting trees to what you showed"))
        demonstrations = Demonstrations.load(self._folder)
        fitted = self._fit(demonstrations, show, stop)
        if fitted is None:
            return
        tree = fitted.policy
        path = self._folder.with_name(f"{self._folder.name}-tree.json")
        tree.save(path)
        played = self._play(tree, show, stop)
        if played is not None:
            self._fitted, self._best, self._presses = fitted, (tree, played, path), 0
            show(self._verdict(result_of_person(demonstrations), note=""))

    def _fit(
        self, demonstrations: "Demonstrations", show: "Show", stop: Callable[[], bool]
    ) -> "FitReport | None":
        """Return the tree chosen by playing, and what to know of it; None if nobody waits."""
        from eutree.fitting.fit import fit
        from eutree.interaction.tree_making import FITTING, TreeView

        def progress(purpose: str, played: int, most: int) -> None:
            if stop():
                raise _NobodyWaits
            if played % BLOCK == 0:
                message = f"{purpose.capitalize()}: {played} of {most} episodes"
                show(TreeView(phase=FITTING, message=message, finished=played, of=most))

        env = self._make()
        try:
            return fit(demonstrations, env, episodes=FITTED, seed=self._seed, on_progress=progress)
        except _NobodyWaits:
            return None
        finally:
            env.close()

    def practise(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Let the tree learn for a while, and keep the better one."""
        from eutree.data import Demonstrations
        from eutree.fitting.practice import practise

        if self._best is None:
            self.make(show, stop)
        if self._best is None or self._fitted is None:
            return
        demonstrations = Demonstrations.load(self._folder)
        person, (_, before, _) = result_of_person(demonstrations), self._best
        episodes = PRACTICE * 2**self._presses
        self._presses += 1
        env, other = self._make(), self._make()
        try:
            curve = _Curve(other, self._practising(person, episodes), show)
            rivals = practise(
                self._fitted.policy,
                demonstrations,
                self._fitted.plays,
                env,
                episodes=episodes,
                seed=self._seed,
                callback=curve,
                stop=stop,
            )
        finally:
            env.close()
            other.close()
        if stop():
            return
        plays = []
        for rival in rivals:
            result = self._play(rival, show, stop)
            if result is None:
                return
            plays.append((result, rival))
        played, tree = max(plays, key=lambda entry: entry[0].value)
        note = f"After {episodes} episodes of practice; before it {before}."
        if played.value > before.value:
            path = self._folder.with_name(f"{self._folder.name}-practised.json")
            tree.save(path)
            self._best = (tree, played, path)
        else:
            note = f"{episodes} episodes of practice found nothing better, only {played}."
        show(replace(self._verdict(person, note=note), curve=curve.points, of=episodes))

    def _play(self, tree: "TreePolicy", show: "Show", stop: Callable[[], bool]) -> Result | None:
        """Let the tree play, the same episodes for every tree; None if nobody waits for it."""
        from eutree.evaluation import Evaluation, evaluate
        from eutree.interaction.tree_making import PLAYING, TreeView

        env, parts = self._make(), list[Evaluation]()
        try:
            for block in range(PLAYED // BLOCK):
                show(
                    TreeView(
                        phase=PLAYING,
                        message=f"The tree plays: {block * BLOCK} of {PLAYED} episodes",
                        finished=block * BLOCK,
                        of=PLAYED,
                        **_drawn(tree),
                    )
                )
                if stop():
                    return None
                parts.append(evaluate(tree, env, episodes=BLOCK, seed=self._seed + block))
        finally:
            env.close()
        return result_of_tree(Evaluation.join(parts))

    def _practising(self, person: Result, episodes: int) -> "TreeView":
        from eutree.interaction.tree_making import PRACTISING, TreeView

        return TreeView(
            phase=PRACTISING,
            message="The tree practises by itself",
            of=episodes,
            yours=person.value,
            is_share=person.successes is not None,
            **({} if self._best is None else _drawn(self._best[0])),
        )

    def _verdict(self, person: Result, *, note: str) -> "TreeView":
        from eutree.interaction.tree_making import READY, TreeView

        if self._best is None:
            raise AssertionError("a verdict needs a tree")
        tree, played, path = self._best
        worse = played.falls_short_of(person)
        may_gain = worse or played.successes is None or played.value < 1.0 - WITHIN
        parts = [note]
        if worse:
            parts.append("It falls short of you; practice may mend that.")
        elif may_gain:
            parts.append("It is as good as you; practice may make it better still.")
        if tree.n_leaves == 1:
            parts.append(f"It has a single leaf: it always answers {_only_action(tree)}.")
        elif worse and self._fitted is not None and tree is self._fitted.policy:
            parts += self._fitted.warnings
        return TreeView(
            phase=READY,
            message=f"you {person}; this tree {played}",
            note=" ".join(filter(None, parts)),
            worse=worse,
            may_gain=may_gain,
            yours=person.value,
            is_share=person.successes is not None,
            commands=self._commands(path),
            **_drawn(tree),
        )

    def _commands(self, path: Path) -> tuple[str, ...]:
        return (
            f"eutree show {path}",
            f"eutree evaluate {path} --episodes 1000",
            f"eutree learn --demos {self._folder} --out {path.with_name('run')}",
            f"eutree export {path} --format c --out {path.with_suffix('.c')}",
        )


class _NobodyWaits(Exception):  # noqa: N818 - no error: whoever pressed the button has left
    """Ends a fit that nobody waits for."""


class _Curve:
    """What the practising tree reaches, shown as it goes on; a callback of ``learn``."""

    def __init__(
        self,
        env: "gymnasium.Env[Any, Any]",
        view: "TreeView",
        show: "Show",
    ) -> None:
        self._env, self._view, self._show = env, view, show
        self._finished = 0
        self._step: dict[str, Any] = {}
        self._model: Any = None
        self.points: tuple[tuple[int, float], ...] = ()
        show(view)

    def init_callback(self, model: Any) -> None:
        """Take the learner."""
        self._model = model

    def update_locals(self, locals_: dict[str, Any]) -> None:
        """Take what is known of the present step."""
        self._step = locals_

    def on_step(self) -> bool:
        """Count finished episodes; after every few of them let the present policy play."""
        if self._step["dones"][0]:
            self._finished += 1
            if self._finished % CURVE_EVERY == 0:
                self.points = (*self.points, (self._finished, self._reached()))
            self._show(
                replace(
                    self._view,
                    message=f"The tree practises: {self._finished} of {self._view.of} episodes",
                    finished=self._finished,
                    curve=self.points,
                )
            )
        return True

    def on_training_start(self, locals_: dict[str, Any], globals_: dict[str, Any]) -> None:
        """Do nothing."""

    def on_rollout_start(self) -> None:
        """Do nothing."""

    def on_rollout_end(self) -> None:
        """Do nothing."""

    def on_training_end(self) -> None:
        """Do nothing."""

    def _reached(self) -> float:
        from eutree.evaluation import evaluate

        played = evaluate(self._model.policy, self._env, episodes=PER_POINT, seed=PLAYED)
        return result_of_tree(played).value


def _drawn(tree: "TreePolicy") -> dict[str, Any]:
    from eutree.export import to_svg

    return {"svg": to_svg(tree), "rules": str(tree), "n_leaves": tree.n_leaves}


def _only_action(tree: "TreePolicy") -> str:
    return str(tree.schema.actions[int(tree.actions[0])])
