"""Draw docs/images/evasion3.png: the 3-Evasion domain while the gate rule plays.

Run: python docs/pictures/make_evasion.py
"""

from pathlib import Path

import gymnasium
import pygame

from eutree import experts

SEED, STEPS = 4, 9
IMAGE = Path(__file__).parents[1] / "images" / "evasion3.png"


def main() -> None:
    env = gymnasium.make("eutree/Evasion3-v0", render_mode="rgb_array")
    expert = experts.wait_at_crossing(env)
    observation, _ = env.reset(seed=SEED)
    for _ in range(STEPS):
        action, _ = expert.predict(observation)
        observation, *_ = env.step(int(action))
    picture = env.render()
    IMAGE.parent.mkdir(exist_ok=True)
    pygame.image.save(pygame.surfarray.make_surface(picture.transpose(1, 0, 2)), IMAGE)


if __name__ == "__main__":
    main()
