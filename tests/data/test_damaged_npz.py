"""Whatever is done to one array of an npz file, it is refused by name or makes demonstrations."""

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.errors import FormatError
from tests.damages import damages

OBS = np.arange(18.0).reshape(9, 2)
LAYOUTS = {
    "trajectories": {
        "obs": OBS,
        "acts": np.array([0, 1, 0, 1, 1, 0]),
        "indices": np.array([2, 4]),
        "terminal": np.array([True, False, True]),
        "rews": np.ones(6),
    },
    "rows": {
        "obs": OBS[:6],
        "acts": np.array([0, 1, 0, 1, 1, 0]),
        "next_obs": OBS[1:7],
        "rews": np.ones(6),
        "dones": np.array([False, True, False, True, False, True]),
        "terminations": np.array([False, True, False, True, False, False]),
        "truncations": np.array([False, False, False, False, False, True]),
        "episode_starts": np.array([True, False, True, False, True, False]),
    },
    "ends alone": {
        "obs": OBS[:6],
        "acts": np.array([0, 1, 0, 1, 1, 0]),
        "terminations": np.array([False, True, False, True, False, False]),
        "truncations": np.array([False, False, False, False, False, True]),
    },
}


@pytest.mark.promise(2)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_damage_to_every_array_is_refused_or_makes_demonstrations(layout, tmp_path):
    arrays, path, refused = LAYOUTS[layout], tmp_path / "demos.npz", 0
    np.savez(path, **arrays)
    assert len(Demonstrations.from_npz(path)) == 3
    for name in arrays:
        for damage, changed in damages(arrays[name]):
            other = {k: a for k, a in arrays.items() if k != name}
            np.savez(path, **other, **({} if changed is None else {name: changed}))
            try:
                Demonstrations.from_npz(path)
            except FormatError as error:
                refused += 1
                if not str(error).startswith(str(path)):
                    raise AssertionError(f"{name}: {damage}: unclear: {error}") from error
            except Exception as error:
                raise AssertionError(f"{name}: {damage}: {error!r}") from error
    assert refused > 5 * len(arrays)


def test_ends_in_a_matrix_are_refused_by_name(tmp_path):
    """It ended in an IndexError: "internal error"."""
    path = tmp_path / "demos.npz"
    np.savez(path, **LAYOUTS["trajectories"] | {"terminal": np.zeros((1, 3), dtype=bool)})
    with pytest.raises(FormatError, match=r"demos\.npz: .*terminal .* of shape \(1, 3\)"):
        Demonstrations.from_npz(path)


@pytest.mark.parametrize("layout", ["rows", "trajectories"])
def test_a_column_of_rewards_is_read_as_one_of_actions_is(layout, tmp_path):
    path, arrays = tmp_path / "demos.npz", LAYOUTS[layout]
    earned = np.arange(6.0)
    np.savez(
        path, **arrays | {"rews": earned[:, np.newaxis], "acts": arrays["acts"][:, np.newaxis]}
    )
    read = Demonstrations.from_npz(path)
    assert np.concatenate([episode.rewards for episode in read]).tolist() == earned.tolist()
