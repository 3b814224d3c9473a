"""Draw docs/images/domains.png: the small domains, the mazes with a shortest way through them.

Run: python docs/pictures/make_domains.py
"""

from pathlib import Path

import gymnasium
import numpy as np
import pygame

import eutree  # noqa: F401 - registers
from eutree_lab.tasks.experts import EXPERTS
from eutree_lab.tasks.registration import TASKS

IMAGE = Path(__file__).parents[1] / "images" / "domains.png"
COLUMNS = 5


def trail(name: str) -> np.ndarray:
    """Return the pictures of an expert's episode on top of each other, or the first one."""
    env = gymnasium.make(name, render_mode="rgb_array", disable_env_checker=True)
    observation, _ = env.reset(seed=3)
    pictures, ended = [env.render()], name not in EXPERTS or "Maze" not in name
    policy = None if ended else next(iter(EXPERTS[name].values()))(env)
    while not ended:
        action, _ = policy.predict(observation)
        observation, _, terminated, truncated, _ = env.step(int(action))
        pictures.append(env.render())
        ended = terminated or truncated
    return np.min(pictures, axis=0)


def main() -> None:
    images = [trail(name)[::2, ::2] for name in TASKS]
    images += [np.full_like(images[0], 255)] * (-len(images) % COLUMNS)
    rows = [np.hstack(images[i : i + COLUMNS]) for i in range(0, len(images), COLUMNS)]
    pygame.image.save(pygame.surfarray.make_surface(np.vstack(rows).transpose(1, 0, 2)), IMAGE)


if __name__ == "__main__":
    main()
