"""What the golden files hold, spelled out without any random generator."""

from eutree.schema import EnvironmentSpec
from tests.data.strategies import three_episodes
from tests.data.test_files import journal_of
from tests.policies.test_document import small_policy


def policy():
    return small_policy()


def demonstrations():
    return three_episodes(EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 2.5}))


def write_journal(path):
    journal_of(three_episodes().episodes[1], path).close()
