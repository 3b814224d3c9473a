"""The currents of a synchronous motor, switched directly: eight states of a bridge of transistors.

A step is 0.1 ms. In coordinates that turn with the rotor the two currents are to follow a demand
of torque; what each state of the bridge does there depends on the rotor's angle.
"""

from typing import Any

import gymnasium
import numpy as np

STEPS, STEP = 200, 1e-4  # of an episode; seconds
RESISTANCE, INDUCTANCE, FLUX = 0.2, (2e-3, 4e-3), 0.1  # ohm, henry along d and q, volt seconds
VOLTAGE, RATED = 300.0, 60.0  # volts of the supply, amperes
DIRECTIONS = np.deg2rad(60.0 * np.arange(6))  # of the six states that are no short circuit


class MotorCurrents(gymnasium.Env[Any, Any]):
    """A motor at a speed of its own for each episode.

    Observation: how far the currents along d and q are below the demand (shares of the rated one),
    sine and cosine of the rotor's electrical angle. Actions: two states that shorten the windings
    and six that put the supply's voltage on them, each in a direction. Reward: minus the root mean
    square of both errors, in per cent of the rated current.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("d missing", "q missing", "sine", "cosine")
    action_names = ("short low", *(f"{60 * k} degrees" for k in range(6)), "short high")

    def __init__(self) -> None:
        high = np.array([20.0, 20.0, 1.0, 1.0])
        self.observation_space = gymnasium.spaces.Box(-high, high, dtype=np.float64)
        self.action_space = gymnasium.spaces.Discrete(8)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin without a current, at any angle and speed."""
        super().reset(seed=seed)
        self._currents, self._step = np.zeros(2), 0
        self._angle = self.np_random.uniform(0.0, 2.0 * np.pi)
        self._speed = self.np_random.uniform(100.0, 600.0)  # electrical, radians a second
        self._demand = self._any_demand()
        return self._observation(), {}

    def step(self, action: int) -> Any:
        """Hold a state of the bridge for a tenth of a millisecond."""
        voltage = np.zeros(2)
        if 1 <= action <= 6:
            seen = DIRECTIONS[action - 1] - self._angle  # from the rotor
            voltage = 2.0 / 3.0 * VOLTAGE * np.array([np.cos(seen), np.sin(seen)])
        (d, q), (along_d, along_q) = self._currents, INDUCTANCE
        induced = self._speed * np.array([-along_q * q, along_d * d + FLUX])
        change = (voltage - RESISTANCE * self._currents - induced) / np.array(INDUCTANCE)
        self._currents = np.clip(self._currents + STEP * change, -10.0 * RATED, 10.0 * RATED)
        self._angle = (self._angle + STEP * self._speed) % (2.0 * np.pi)
        if self.np_random.random() < 0.02:
            self._demand = self._any_demand()
        self._step += 1
        error = (self._demand - self._currents) / RATED
        reward = -100.0 * float(np.sqrt(np.mean(error**2))) / STEPS
        return self._observation(), reward, False, self._step >= STEPS, {}

    def _any_demand(self) -> Any:
        return RATED * np.array([self.np_random.uniform(-0.4, 0.0), self.np_random.uniform(-1, 1)])

    def _observation(self) -> Any:
        missing = (self._demand - self._currents) / RATED
        return np.array([*missing, np.sin(self._angle), np.cos(self._angle)])


def towards_the_error(observation: Any) -> int:
    """Put the voltage in the direction of the missing current: the rule of thumb."""
    d, q, sine, cosine = observation[:4]
    if np.hypot(d, q) < 0.05:
        return 0
    wanted = np.arctan2(q, d) + np.arctan2(sine, cosine)
    return 1 + round(float(wanted) / (np.pi / 3.0)) % 6


gymnasium.register("MotorCurrents-v0", MotorCurrents, max_episode_steps=STEPS)
