"""What a run does next: a function of its plan and its position, and of nothing else."""

import pytest
from msgspec.structs import replace

import eutree
from eutree.errors import InvalidArgumentError
from eutree.training.phases import MANY, Phase, Plan, Position, due
from eutree.training.proposals import SearchSettings


def course(
    plan,
    *,
    length=10,
    gathering_episodes=2,
    gathering_steps=None,
    max_episode_steps=10,
    settles=99,
    races=3,
):
    """Return the names of all phases of a run whose episodes take ``length`` steps."""
    at, names = Position(), []
    while (
        phase := due(
            plan,
            at,
            gathering_episodes=gathering_episodes,
            gathering_steps=gathering_steps,
            max_episode_steps=max_episode_steps,
        )
    ) is not None:
        names.append(f"{phase[0]}{at.episode}")
        here = at.episode
        at = {
            Phase.GATHER: lambda a: replace(
                a, episode=a.episode + 1, steps=a.steps + length, longest=length
            ),
            Phase.UPDATE: lambda a, h=here: replace(
                a,
                updates=a.updates + 1,
                updated_at=h,
                updated_steps=a.steps,
                settled=a.updates + 1 >= settles,
            ),
            Phase.EVALUATE: lambda a, h=here: replace(a, evaluated_at=h),
            Phase.RACE: lambda a: replace(
                a,
                racing_steps=a.racing_steps + length,
                raced=a.racing_steps + length >= races * length,
                evaluated_at=-1 if a.racing_steps + length >= races * length else a.evaluated_at,
            ),
            Phase.JUDGE: lambda a: replace(a, judged=True),
        }[phase](at)
    return " ".join(names)


RACE = SearchSettings(steps=30)


def test_a_run_gathers_updates_evaluates_and_is_judged():
    plan = Plan(episodes=5, evaluate_every=3)
    assert course(plan) == "e0 g0 g1 u2 g2 e3 g3 u4 g4 u5 e5 j5"


def test_long_episodes_are_learned_from_after_fewer_of_them():
    plan = Plan(episodes=8, evaluate_every=99)
    long = course(plan, length=10, gathering_episodes=20, gathering_steps=60)
    assert long == "e0 g0 g1 g2 g3 g4 g5 u6 g6 g7 u8 e8 j8"
    short = course(plan, length=3, gathering_episodes=20, gathering_steps=60)
    assert short.count("u") == 1
    longest = course(plan, length=100, gathering_episodes=20, gathering_steps=60)
    assert "g4 u5 g5" in longest  # five of them at least


def test_racing_is_a_phase_of_the_run_and_its_result_is_evaluated():
    plan = Plan(episodes=2, evaluate_every=2, race=RACE)
    assert course(plan) == "e0 g0 g1 u2 e2 r2 r2 r2 e2 j2"


def test_a_run_of_no_episodes_can_race():
    assert course(Plan(episodes=0, race=RACE)) == "e0 r0 r0 r0 e0 j0"


def test_recorded_episodes_alone_are_learned_from_until_nothing_changes():
    plan = Plan(episodes=9, gathers=False)
    assert course(plan, settles=3) == "u0 u0 u0"
    assert course(plan) == " ".join(["u0"] * 9)


@pytest.mark.parametrize(("steps", "episodes"), [(30, 3), (39, 3), (40, 4), (9, 0)])
def test_an_episode_begins_only_if_the_longest_possible_one_fits(steps, episodes):
    plan = Plan(episodes=MANY, steps=steps)
    assert course(plan, length=10).count("g") == episodes


def test_steps_are_set_aside_for_racing():
    plan = Plan(episodes=MANY, steps=70, race=RACE)
    assert course(plan).count("g") == 4


def test_without_a_limit_the_longest_episode_so_far_counts():
    assert course(Plan(episodes=MANY, steps=25), max_episode_steps=None).count("g") == 2


def test_the_clock_ends_gathering():
    plan = Plan(episodes=MANY, seconds=5.0)  # of which one is kept for the end
    late = Position(episode=3, seconds=3.1)  # one more would take another second
    assert due(plan, late, gathering_episodes=9, max_episode_steps=None) == Phase.UPDATE
    early = replace(late, seconds=2.9)
    assert due(plan, early, gathering_episodes=9, max_episode_steps=None) == Phase.GATHER


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"episodes": -1}, "episodes"),
        ({"steps": 0}, "steps"),
        ({"seconds": 0.0}, "seconds"),
        ({"evaluate_every": 0}, "evaluate_every"),
    ],
)
def test_bad_plans_are_named(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Plan(**arguments)


def test_a_budget_in_which_no_episode_fits_is_refused():
    """Nothing was gathered, without a word."""
    with pytest.raises(InvalidArgumentError, match="for an episode, which may take 500, got 100"):
        eutree.learn("CartPole-v1", steps=100)
    with pytest.raises(InvalidArgumentError, match="500 beside the 900 of race_steps, got 1,000"):
        eutree.learn("CartPole-v1", steps=1000, race_steps=900)
