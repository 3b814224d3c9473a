"""Partitions drawn: an image of its own, made while a run goes on, shown in its report."""

import base64
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from eutree.cli.main import run
from eutree.learners.partition import Partition, Plane, PlaneRegion
from eutree.report import drawings, partition_chart
from eutree.schema import Feature, Schema

SCHEMA = Schema(
    (Feature("place <b>", "m"), Feature("speed"), Feature("door")), ("stay & wait", "go")
)
PLANE = Plane(0, 1, np.array([0.0, 0.0, 7.0]), np.array([0.0, -1.0]), np.array([4.0, 1.0]))
SQUARE = np.array([[0.0, -1.0], [2.0, -1.0], [2.0, 1.0], [0.0, 1.0]])
BESIDE = SQUARE + np.array([2.0, 0.0])
SVG = "{http://www.w3.org/2000/svg}"
SHORT = ("--episodes", "3", "--evaluate-every", "3", "--evaluation-episodes", "1")


def drawn(*regions, **others):
    return ET.fromstring(partition_chart(Partition(PLANE, regions, "value"), SCHEMA, **others))


def test_regions_lie_where_they_are_and_say_what_they_are():
    root = drawn(PlaneRegion(SQUARE, 0, 2.5), PlaneRegion(BESIDE, 1, -1.0))
    left, right = root.iter(f"{SVG}polygon")
    frame = next(root.iter(f"{SVG}rect"))
    edges = [float(frame.get("x")), float(frame.get("x")) + float(frame.get("width"))]

    def ends(polygon):
        places = [float(pair.split(",")[0]) for pair in polygon.get("points").split()]
        return min(places), max(places)

    middle = sum(edges) / 2
    assert ends(left) == pytest.approx((edges[0], middle), abs=0.1)
    assert ends(right) == pytest.approx((middle, edges[1]), abs=0.1)
    assert float(left.get("fill-opacity")) > float(right.get("fill-opacity"))
    titles = [title.text for title in root.iter(f"{SVG}title")][1:]
    assert titles == ["stay & wait, value 2.5", "go, value -1"]
    words = " ".join(root.itertext())
    assert "place <b> [m]" in words
    assert "door = 7" in next(root.iter(f"{SVG}desc")).text


def test_the_ticks_stand_at_their_axes():
    root = drawn(PlaneRegion(SQUARE, 0, 1.0))
    frame = next(root.iter(f"{SVG}rect"))
    left = float(frame.get("x"))
    across = [float(t.get("x")) for t in root.iter(f"{SVG}text") if t.text == "0.5"]
    assert across == [left - 6.0]


def test_costs_are_written_into_cells_and_what_is_lost_has_none():
    lost = PlaneRegion(BESIDE, value=float("inf"))
    root = drawn(PlaneRegion(SQUARE, value=3.0), lost)
    numbers = [t.text for t in root.iter(f"{SVG}text") if t.get("class") == "number"]
    assert numbers == ["3"]
    assert [p.get("class") for p in root.iter(f"{SVG}polygon")] == ["region cell", "region lost"]
    assert "1 lost" in next(root.iter(f"{SVG}desc")).text


def test_a_way_is_drawn_and_what_is_unknown_is_drawn_too():
    root = drawn(PlaneRegion(SQUARE, 0), path=np.array([[0.0, 0.0], [1.0, 0.5], [99.0, 0.5]]))
    way = next(root.iter(f"{SVG}polyline")).get("points").split()
    assert len(way) == 3
    assert next(root.iter(f"{SVG}polygon")).get("fill-opacity") == "0.40"


def test_a_run_draws_its_partition_and_shows_it_in_its_report(tmp_path, capsys):
    out = tmp_path / "a"
    arguments = ["learn", "MountainCar-v0", *SHORT, "--out", str(out)]
    assert run([*arguments, "--method", "density-tree", "--set", "gathering_episodes=1",
                "--partition", "position,velocity", "--json"]) == 0  # fmt: skip
    json.loads(capsys.readouterr().out)
    names = sorted(path.name for path in (out / "partitions").iterdir())
    assert names == [f"after-{n:06d}-updates.svg" for n in (0, 1, 2, 3)]
    shown = drawings(out / "partitions")
    sizes = [len(list(ET.fromstring(text).iter(f"{SVG}polygon"))) for _, text in shown]
    assert sizes[0] == 1
    assert sizes == sorted(sizes)
    assert sizes[-1] > 1
    assert shown[1][0].startswith("After 1 update: ")
    assert run(["show", str(out), "--run-html", str(tmp_path / "a.html")]) == 0
    page = (tmp_path / "a.html").read_text()
    images = re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)
    assert [base64.b64decode(image).decode() for image in images] == [text for _, text in shown]


def test_what_cannot_be_drawn_is_refused(tmp_path, capsys):
    out = str(tmp_path / "a")
    for features, message in (
        ("position", "two features X,Y"),
        ("position,nowhere", "nowhere"),
        ("position,position", "two features"),
    ):
        assert run(["learn", "MountainCar-v0", *SHORT, "--out", out, "--method", "u-tree",
                    "--partition", features]) != 0  # fmt: skip
        assert message in capsys.readouterr().err
    assert run(["learn", "MountainCar-v0", *SHORT, "--out", out, "--runs", "2",
                "--partition", "position,velocity"]) != 0  # fmt: skip
    assert "--runs" in capsys.readouterr().err
