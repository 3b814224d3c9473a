"""A checkpoint holds all of a run, however long it was, and nothing else is taken for one."""

import numpy as np
import pytest

from eutree.errors import FormatError
from eutree.files import read_archive, read_arrays, write_archive
from eutree.files.documents import MAX_DOCUMENT
from eutree.learners import PAPER
from eutree.training.checkpoint import (
    CheckpointDocument,
    events_to_text,
    restore_checkpoint,
    write_checkpoint,
)
from tests.files.loaders import unstarted
from tests.golden.contents import METHODS
from tests.golden.versions import VERSIONS


def test_a_run_with_more_to_tell_than_a_document_holds_is_saved_and_goes_on(tmp_path):
    """Once a run of a million episodes could not be saved any more."""
    run = unstarted(PAPER)
    facts = {"success_rate": None, "mean_return": 1 / 3, "n_leaves": 1, "mean_length": 2 / 3}
    splits = [{"leaf": 0, "feature": 1, "threshold": 1 / 3}] * 1000
    for episode in range(0, 6000, 20):
        here = {"episode": episode, "steps": 50 * episode}
        run.state.events.append({"event": "expansion", **here, "splits": splits, "n_leaves": 1})
        run.state.events.append({"event": "evaluation", **here, **facts})
    assert len(events_to_text(run.state.events)) > MAX_DOCUMENT
    write_checkpoint(tmp_path / "checkpoint.npz", run)
    again = unstarted(PAPER)
    restore_checkpoint(tmp_path / "checkpoint.npz", again)
    assert again.state.events == run.state.events
    assert (len(again.curve), again.curve[-1].episode) == (300, 5980)


def newest(run):
    path = VERSIONS[-1] / run / "checkpoint.npz"
    return {name: array.copy() for name, array in read_arrays(path).items()}


def as_text(text):
    return np.frombuffer(text.encode(), dtype=np.uint8)


DAMAGES = {
    "an array less": ("history_rewards", lambda a: None, "history_rewards: missing"),
    "one more": ("extra", lambda a: np.zeros(1), "extra: unexpected array"),
    "another type": ("history_rewards", lambda a: a.astype(np.float32).astype(np.int32), "fit"),
    "a row less": ("history_actions", lambda a: a[1:], "history_actions: shape .* does not fit"),
    "another action": ("history_actions", lambda a: a + 2, r"must be in 0\.\.1, got 2\.\.3"),
    "NaN": ("history_rewards", lambda a: a * np.nan, "history_rewards: must be finite"),
    "infinity": ("mdp_action_values", lambda a: a + np.inf, "must not be infinite"),
    "no priority": ("mdp_priority", lambda a: a * np.nan, "mdp_priority: must be a number"),
    "no tree": ("left", lambda a: a * 0, "not a tree"),
    "an episode that comes back": ("history_episodes", lambda a: a[::-1].copy(), "must ascend"),
    "no such leaf": ("mdp_queue", lambda a: np.array([9], np.int32), "mdp_queue: must be in"),
    "a queue with one twice": ("mdp_queue", lambda a: np.zeros(2, np.int32), "twice"),
    "a bound of nothing": ("history_bounds", lambda a: a * np.uint64(0), "history_bounds: must be"),
    "no such episode": (
        "plan_incumbent_episodes",
        lambda a: np.array([99]),
        "plan_incumbent_episodes: must be in",
    ),
    "a node beyond": ("plan_incumbent_left", lambda a: a + 2**32, "must be in|not a tree"),
    "no planned action": (
        "plan_incumbent_action",
        lambda a: a + 7,
        "plan_incumbent_action: must be in",
    ),
    "no events": ("run_events", lambda a: None, "run_events: must be there"),
    "events that are none": ("run_events", lambda a: as_text("[]\n"), "run_events, line 1"),
    "an event without name": ("run_events", lambda a: as_text('{"a":1}\n'), "event must be a name"),
    "an event out of time": ("run_events", lambda a: as_text('{"event":"x"}\n'), "episode must be"),
    "half an evaluation": (
        "run_events",
        lambda a: as_text('{"event":"evaluation","episode":1}\n'),
        "not those of a run|an evaluation",
    ),
    "episodes of no length": ("episode_lengths", lambda a: a[1:], "episode_lengths: shape"),
}


@pytest.mark.promise(2)
@pytest.mark.parametrize("damage", DAMAGES)
def test_every_damage_is_refused_with_its_array(tmp_path, damage):
    name, change, message = DAMAGES[damage]
    run = "run-bounded" if name.startswith("mdp") else "run-planned-bounded"
    arrays = newest(run)
    changed = change(arrays.pop(name, None))
    if changed is not None:
        arrays[name] = changed
    path = tmp_path / "checkpoint.npz"
    document, _ = read_archive(VERSIONS[-1] / run / "checkpoint.npz", CheckpointDocument)
    write_archive(path, document, arrays)
    with pytest.raises(FormatError, match=message) as caught:
        restore_checkpoint(path, unstarted(METHODS[run]))
    assert "\n" not in str(caught.value)
