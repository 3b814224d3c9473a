"""Environments, each with one fault that the border must stop."""

import asyncio
import datetime
import sys

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete


class Healthy(gymnasium.Env):
    """Two numbers in [0, 1]; action 1 moves right; ends after five steps."""

    observation_space = Box(0.0, 1.0, (2,), np.float64)
    action_space = Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.array([self.np_random.random(), 0.0]), {}

    def step(self, action):
        self.count += 1
        observation = np.array([self.np_random.random(), self.count / 5])
        return observation, float(action), self.count == 5, False, {"is_success": True}


def moves(observation):
    """Demonstrate."""
    return int(observation[0] > 0.5)


def answering(**changes):
    """Return a healthy environment whose third step answers otherwise."""
    names = ("observation", "reward", "terminated", "truncated", "info")

    class Sick(Healthy):
        def step(self, action):
            answer = dict(zip(names, super().step(action), strict=True))
            return tuple((changes if self.count == 3 else {}).get(n, answer[n]) for n in names)

    return Sick()


class FourValues(Healthy):
    def step(self, action):
        return super().step(action)[:4]


class SixValues(Healthy):
    def step(self, action):
        return (*super().step(action), None)


class RaisesInStep(Healthy):
    def step(self, action):
        raise KeyError("motor")


class RaisesInReset(Healthy):
    def reset(self, *, seed=None, options=None):
        raise OSError("no device")


class ExitsInStep(Healthy):
    def step(self, action):
        sys.exit(0)


class ExitsInReset(Healthy):
    def reset(self, *, seed=None, options=None):
        sys.exit("no licence")


class Nameless:
    def __repr__(self):
        raise RuntimeError("no name")


class WordlessError(Exception):
    def __str__(self):
        raise RuntimeError("no words")


def raising(error, *, at="step"):
    """Return an environment whose ``step`` or ``reset`` raises an error."""

    class Raises(Healthy):
        def answer(self, *arguments, **options):
            raise error

    setattr(Raises, at, Raises.answer)
    return Raises()


class ResetWithoutDict(Healthy):
    def reset(self, *, seed=None, options=None):
        return super().reset(seed=seed)[0], None


class ResetWithoutInfo(Healthy):
    def reset(self, *, seed=None, options=None):
        return super().reset(seed=seed)[0]


class NaNAtReset(Healthy):
    def reset(self, *, seed=None, options=None):
        return np.array([np.nan, 0.0]), super().reset(seed=seed)[1]


class NeverEnds(Healthy):
    def step(self, action):
        observation, reward, _, _, info = super().step(action)
        return np.minimum(observation, 1.0), reward, False, False, info


SICK = {
    "NaN observation": (answering(observation=np.array([np.nan, 0])), "step 2: .*finite.*nan"),
    "infinite observation": (answering(observation=np.array([np.inf, 0])), "finite.*inf"),
    "giant observation": (answering(observation=np.array([1e200, 0])), "at most 1e.100.*1e.200"),
    "complex observation": (answering(observation=np.zeros(2) + 1j), "complex and masked arrays"),
    "masked observation": (answering(observation=np.ma.masked_all(2)), "complex and masked arrays"),
    "wrong shape": (answering(observation=np.zeros(3)), r"shape \(2,\), got \(3,\)"),
    "matrix": (answering(observation=np.zeros((2, 1))), r"shape \(2,\), got \(2, 1\)"),
    "text observation": (answering(observation=["a", "b"]), "observation must be of Box"),
    "numeric texts": (answering(observation=["0.5", "1"]), "no kind of number"),
    "an array of objects": (answering(observation=np.array(["1", 0.5], object)), "texts are no"),
    "dates": (answering(observation=np.zeros(2, "datetime64[s]")), "no kind of number"),
    "a date": (answering(observation=[datetime.datetime(2026, 1, 1)] * 2), "observation must be"),
    "no observation": (answering(observation=None), "observation must"),
    "text reward": (answering(reward="1.0"), "reward must be a finite number, got '1.0'"),
    "NaN reward": (answering(reward=np.nan), "reward must be a finite number .*, got nan"),
    "infinite reward": (answering(reward=-np.inf), "reward must be a finite number .*, got -inf"),
    "giant reward": (answering(reward=-1e300), "reward must be a finite number of at most 1e.100"),
    "no reward": (answering(reward=None), "reward must be a finite number, got None"),
    "vector reward": (answering(reward=np.zeros(2)), "reward must be a finite number"),
    "overflowing reward": (answering(reward=10**400), "reward must be a finite number"),
    "text flag": (answering(terminated="no"), "terminated must be a bool, got 'no'"),
    "number flag": (answering(truncated=1), "truncated must be a bool, got 1"),
    "info is a list": (answering(info=[]), "info must be a dict"),
    "info is None": (answering(info=None), "info must be a dict, got None"),
    "success of several": (answering(info={"is_success": np.ones(2)}), r"'is_success'\] must be"),
    "success in words": (answering(info={"is_success": "yes"}), "or 1 or 0.*, got 'yes'"),
    "success is NaN": (answering(info={"is_success": np.nan}), "or 1 or 0.*, got nan"),
    "success by half": (answering(info={"is_success": 0.5}), "or 1 or 0.*, got 0.5"),
    "exit in step": (ExitsInStep(), "step 0: step raised SystemExit: 0"),
    "exit in reset": (ExitsInReset(), r"reset: reset\(seed=0\) raised SystemExit: no licence"),
    "reset with None as info": (ResetWithoutDict(), "reset: info must be a dict, got None"),
    "four values": (FourValues(), "a tuple of 4 values"),
    "six values": (SixValues(), "a tuple of 6 values"),
    "exception in step": (RaisesInStep(), "step 0: step raised KeyError: 'motor'"),
    "exception in reset": (RaisesInReset(), r"reset: reset\(seed=0\) raised OSError: no device"),
    "end of a generator in step": (raising(GeneratorExit()), "step raised GeneratorExit$"),
    "end of a generator in reset": (
        raising(GeneratorExit("over"), at="reset"),
        "GeneratorExit: over",
    ),
    "cancelled": (raising(asyncio.CancelledError()), "step raised CancelledError$"),
    "wordless in step": (raising(WordlessError()), "step 0: step raised WordlessError$"),
    "wordless in reset": (raising(WordlessError(), at="reset"), r"seed=0\) raised WordlessError$"),
    "error of several lines": (raising(OSError("a\n  b")), "step raised OSError: a b$"),
    "nameless reward": (answering(reward=Nameless()), "finite number, got a Nameless$"),
    "reset without info": (ResetWithoutInfo(), r"reset must return \(observation, info\)"),
    "NaN at reset": (NaNAtReset(), "reset: observation must be finite"),
    "never ends": (NeverEnds(), "has not ended after 50 steps"),
}
