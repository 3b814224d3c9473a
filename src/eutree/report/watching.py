"""Episodes with pictures, to be played on the policy's page."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.errors import EnvironmentFault, EutreeError, InvalidArgumentError, needed
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.deriving import acting_as
from eutree.interaction.episode import Stream
from eutree.interaction.making import make
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.validation import check_integer, check_seed

# Small enough for dozens of episodes in one page, large enough to see the motion.
_WIDTH, _QUALITY = 480, 60
_EFFORT = 2  # of 0..6 to make a picture small: 4, as usual, takes twice the time for a tenth less
_ENCODERS, _AHEAD = ThreadPoolExecutor(4), 16  # and how many pictures may wait for one

# Long episodes take long to draw, and a page could not hold them all.
PICTURE_LIMIT = 1500


@dataclass(frozen=True, eq=False)
class WatchedEpisode:
    """An episode and its pictures.

    Attributes:
        episode: The recorded steps.
        frames: An encoded picture for each observation; empty where there are none.
        by: Whose episode it is, if not simply that of the policy watched.
    """

    episode: Episode
    frames: tuple[bytes, ...] = ()
    by: str = ""

    def __post_init__(self) -> None:
        if self.frames and len(self.frames) != len(self.episode.observations):
            raise InvalidArgumentError(
                f"frames must be one for each of the {len(self.episode.observations)} "
                f"observations, or none, got {len(self.frames)}"
            )


def watch(
    policy: TreePolicy,
    spec: EnvironmentSpec | None = None,
    *,
    episodes: int = 10,
    seed: int = 0,
    pictures: bool = True,
    on_episode: Callable[[int], None] | None = None,
) -> list[WatchedEpisode]:
    """Let the policy act in its environment and record the observations and pictures.

    Args:
        policy: The policy to watch.
        spec: The environment; by default the one that the policy was made for.
        episodes: How many to play.
        seed: Seed of the recording.
        pictures: Whether to record pictures, which needs Pillow (extra ``record``). Episodes
            that begin after ``PICTURE_LIMIT`` pictures have none.
        on_episode: Is told after each episode how many there are.

    Raises:
        InvalidArgumentError: There is no environment, or it is not the policy's.
    """
    count = check_integer("episodes", episodes, low=1)
    check_seed(seed)
    spec = spec or policy.environment
    if spec is None:
        raise InvalidArgumentError("spec must name an environment: the policy names none")
    if pictures:
        with closing(make(spec)) as plain_env:
            modes = plain_env.metadata.get("render_modes", ())
        if "rgb_array" not in modes:
            raise InvalidArgumentError(
                f"{spec.id} draws none: its metadata['render_modes'] must name rgb_array"
            )
    made = make(spec, render_mode="rgb_array" if pictures else None)
    with closing(acting_as(made, policy)) as env:
        plain, filmed = GuardedEnv(env), _FilmedEnv(env)
        if plain.schema.n_features != policy.observation_size:
            raise InvalidArgumentError(
                f"spec must name an environment with {policy.observation_size} features, "
                f"{spec} has {plain.schema.n_features}"
            )
        watched: list[WatchedEpisode] = []
        for number in range(count):
            room = sum(len(entry.frames) for entry in watched) < PICTURE_LIMIT
            chosen = episode_seed(seed, number, Stream.WATCHING)
            episode = run_episode(filmed if pictures and room else plain, policy, chosen)
            watched.append(WatchedEpisode(episode, filmed.frames if pictures and room else ()))
            if on_episode is not None:
                on_episode(len(watched))
        return watched


def watch_if_possible(
    policy: TreePolicy, spec: EnvironmentSpec | None, **options: Any
) -> tuple[list[WatchedEpisode], str]:
    """Return episodes, with pictures where that works, and one line on the failure, if any.

    The options are those of ``watch``.
    """
    problem = ""
    for pictures in (True, False):
        try:
            watched = watch(policy, spec, pictures=pictures, **options)
        except EutreeError as error:
            if isinstance(error, EnvironmentFault) and not pictures:
                raise
            problem = problem or str(error)
        else:
            return watched, problem and f"no pictures: {problem}"
    return [], f"no episodes: {problem}"


def film(spec: EnvironmentSpec, episode: Episode) -> WatchedEpisode:
    """Replay a recorded episode, whose seed must be known, and take a picture of each observation.

    Raises:
        InvalidArgumentError: The environment draws no pictures, or the episode goes otherwise.
    """
    with closing(make(spec, render_mode="rgb_array")) as env:
        filmed, is_over = _FilmedEnv(env), False
        seen = [filmed.reset(episode.seed)]
        for action in episode.actions.tolist():
            if not is_over:
                observation, _, terminated, truncated, _ = filmed.step(action)
                seen.append(observation)
                is_over = terminated or truncated
    if not np.array_equal(np.array(seen), episode.observations, equal_nan=True):
        raise InvalidArgumentError(f"episode must go as recorded in {spec}, it went otherwise")
    return WatchedEpisode(episode, filmed.frames)


def film_if_possible(spec: EnvironmentSpec, episode: Episode, *, by: str = "") -> WatchedEpisode:
    """Return an episode with pictures where they can be had, else without."""
    try:
        return replace(film(spec, episode), by=by)
    except EutreeError:
        return WatchedEpisode(episode, by=by)


class _FilmedEnv(GuardedEnv):
    """Takes a picture after every reset and step; threads encode them while the episode goes on."""

    _taken: list[Future[bytes]]

    @property
    def frames(self) -> tuple[bytes, ...]:
        """The pictures of the present episode, encoded."""
        return tuple(one.result() for one in self._taken)

    def reset(self, seed: int | None = None) -> Floats:
        observation = super().reset(seed)
        self._taken = []
        self._take()
        return observation

    def step(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        answer = super().step(action)
        self._take()
        return answer

    def _take(self) -> None:
        if len(self._taken) >= _AHEAD:
            self._taken[-_AHEAD].result()
        self._taken.append(_ENCODERS.submit(encode, self.picture().copy()))


def encode(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture, shape [height, width, 3], as WebP, at most 480 pixels wide."""
    with needed("pillow", "record"):
        from PIL import Image
    image = Image.fromarray(picture)
    if image.width > _WIDTH:
        height = max(1, round(_WIDTH * image.height / image.width))
        # Twice as fast as LANCZOS, a tenth smaller, and to the eye the same at these sizes.
        image = image.resize((_WIDTH, height), Image.Resampling.BILINEAR)
    content = BytesIO()
    try:
        image.save(content, "WEBP", quality=_QUALITY, method=_EFFORT)
    except (KeyError, OSError) as error:
        raise InvalidArgumentError(f"Pillow must be able to write WebP: {error}") from error
    return content.getvalue()
