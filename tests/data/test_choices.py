"""Text in a log is a category, and has the code that a schema has for it."""

import numpy as np
import pytest

from eutree.data import DemonstrationFolder, Demonstrations, LogFormat, derive
from eutree.errors import FormatError, InvalidArgumentError
from eutree.schema import Feature, Schema

ROWS = "episode,action,room,mode\n0,on,15,manual\n0,off,15,auto\n0,on,16,manual\n0,,15,auto\n"


def heating(*categories, low=0.0):
    mode = Feature("mode", "", low, low + len(categories) - 1, True, categories)
    return Schema((Feature("room"), mode), ("off", "on"))


def grouped(*categories):
    flags = (Feature(f"mode is {c}", "", 0.0, 1.0, True, group="mode") for c in categories)
    return Schema((Feature("room"), *flags), ("off", "on"))


def read(folder, schema, rows=ROWS):
    (folder / "log.csv").write_text(rows)
    return Demonstrations.from_csv(
        folder / "log.csv", schema=schema, log=LogFormat(nominal=("mode",))
    )


@pytest.mark.parametrize(
    ("schema", "codes"),
    [
        (heating("auto", "manual"), [1, 0, 1, 0]),
        (heating("manual", "auto"), [0, 1, 0, 1]),
        (heating("off", "manual", "auto"), [1, 2, 1, 2]),
        (heating("manual", "auto", low=3.0), [3, 4, 3, 4]),
    ],
)
def test_a_text_has_the_code_that_the_schema_gives_it(tmp_path, schema, codes):
    """Categories were numbered by the alphabet, so rules said the opposite of the log."""
    demos = read(tmp_path, schema)
    assert demos.schema == schema
    assert demos.observations.tolist() == [[15, codes[0]], [15, codes[1]], [16, codes[2]]]
    assert demos.episodes[0].observations[:, 1].tolist() == codes


def test_a_group_is_read_though_some_of_its_categories_do_not_occur(tmp_path):
    demos = read(tmp_path, grouped("off", "manual", "auto"))
    assert demos.episodes[0].observations[:, 1:].tolist() == [
        [0, 1, 0],
        [0, 0, 1],
        [0, 1, 0],
        [0, 0, 1],
    ]


@pytest.mark.parametrize("schema", [heating("auto", "manual"), grouped("off", "auto", "manual")])
def test_a_text_that_is_no_category_is_refused(tmp_path, schema):
    with pytest.raises(FormatError, match=r"mode must be one of .*auto, manual, got 'hand'"):
        read(tmp_path, schema, ROWS.replace("15,auto", "15,hand"))


def test_a_column_taken_by_its_place_has_the_same_categories(tmp_path):
    schema = Schema(
        (Feature("room"), Feature("Mode", "", 0, 1, True, ("manual", "auto"))), ("off", "on")
    )
    with pytest.raises(FormatError, match=r"categories of Mode, manual, auto, got auto, manual"):
        read(tmp_path, schema)


def test_demonstrations_of_other_codes_do_not_mix(tmp_path):
    """What was "manual" in one episode was "auto" in another, and every "night" "manual"."""
    folder = DemonstrationFolder.create(tmp_path / "demos", heating("auto", "manual"))
    for others in (("manual", "auto"), ("manual", "night"), ("auto", "night")):
        with pytest.raises(InvalidArgumentError, match="other features or actions"):
            folder.check_same(heating(*others), None)
    folder.check_same(heating("auto", "manual"), None)


def test_features_can_be_derived_anew(tmp_path):
    demos = derive(read(tmp_path, heating("auto", "manual")), ["warm = room + mode"])
    anew = derive(demos, ["warm = room - mode"], anew=True)
    assert anew.schema.feature_names == ("room", "mode", "warm")
    np.testing.assert_array_equal(anew.observations[:, 2], [14, 15, 15])
    with pytest.raises(InvalidArgumentError, match="a name of its own"):
        derive(demos, ["warm = room - mode"])
