"""A slow, obvious N-Evasion in plain Python numbers: the twin of the dynamics and the kernel."""

import math

import numpy as np

ENDINGS = {"goal": 100.0, "collision": -50.0, "time limit": 0.0, None: 0.0}


def bounce(place: float, direction: float, distance: float, half: float) -> tuple[float, float]:
    """Walk ``distance``, turning round at each end, one leg after the other."""
    while True:
        to_end = half - place if direction > 0 else place + half
        if distance < to_end:
            return place + direction * distance, direction
        distance -= to_end
        place, direction = math.copysign(half, direction), -direction


def halt(place: float, direction: float, distance: float, half: float) -> tuple[float, float]:
    """Walk ``distance``, or as far as the end, and turn round there."""
    there = place + direction * distance
    if -half <= there < half:
        return there, direction
    return (half if there >= half else -half), -direction


class NaiveEvasion:
    """Default rewards; everything else from the parameters."""

    def __init__(self, parameters) -> None:
        self.parameters = parameters

    def reset(self, generator: np.random.Generator) -> list[float]:
        p = self.parameters
        uniforms = generator.random(2 * p.n_opponents).tolist()
        self.noise = generator.standard_normal((p.max_steps, p.n_opponents + 1)).tolist()
        self.position, self.step_number = 0.0, 0
        self.places = [(2 * u - 1) * p.path_length / 2 for u in uniforms[: p.n_opponents]]
        self.directions = [-1.0 if u < 0.5 else 1.0 for u in uniforms[p.n_opponents :]]
        if p.start == "either end":
            self.places = [-d * p.path_length / 2 for d in self.directions]
        if p.start == "same end":
            self.places, self.directions = (
                [p.path_length / 2] * p.n_opponents,
                [-1.0] * p.n_opponents,
            )
        return [self.position, *self.places]

    def step(self, action: int) -> tuple[list[float], float, str | None]:
        p = self.parameters
        mine, *theirs = [max(0.0, 1 + p.noise * z) for z in self.noise[self.step_number]]
        self.step_number += 1
        if action == 1:
            self.position = min(
                self.position + p.agent_speed * p.time_step * mine, p.main_path_length
            )
        for i, factor in enumerate(theirs):
            distance = p.opponent_speed * p.time_step * factor
            walk = bounce if p.bounce == "reflect" else halt
            self.places[i], self.directions[i] = walk(
                self.places[i], self.directions[i], distance, p.path_length / 2
            )
        ending = self.ending()
        reward = (-2.0 if action == 0 else 0.0) + ENDINGS[ending]
        return [self.position, *self.places], reward, ending

    def ending(self) -> str | None:
        p = self.parameters
        for crossing, place in zip(p.crossing, self.places, strict=True):
            if math.dist((self.position, 0.0), (crossing, place)) <= p.collision_distance:
                return "collision"
        if self.position >= p.main_path_length:
            return "goal"
        return "time limit" if self.step_number >= p.max_steps else None
