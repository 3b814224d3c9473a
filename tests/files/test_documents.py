"""Documents: deterministic bytes out, nothing but the declared in."""

import math
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import field

import eutree
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files.documents import (
    Document,
    decode_document,
    encode_document,
    read_document,
    write_document,
)


class Thing(Document, frozen=True, kw_only=True):
    FORMAT: ClassVar[str] = "test/thing"
    VERSION: ClassVar[int] = 2

    number: float
    maybe: list[float | None] = field(default_factory=list)
    rest: dict[str, Any] = field(default_factory=dict)
    items: list[dict[str, int]] = field(default_factory=list)


def bits(x):
    return None if x is None else math.copysign(1, x), x


finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.promise(4)
@given(finite, st.lists(st.none() | finite), st.dictionaries(st.text(), finite | st.text()))
def test_what_is_written_is_read_back_to_the_bit(number, maybe, rest):
    data = encode_document(Thing(number=number, maybe=maybe, rest=rest))
    thing = decode_document(data, Thing, "f")
    assert encode_document(thing) == data
    assert bits(thing.number) == bits(number)
    assert list(map(bits, thing.maybe)) == list(map(bits, maybe))
    assert thing.rest == rest


def test_the_bytes_are_these():
    data = encode_document(Thing(number=-0.0, maybe=[5e-324, None], items=[{"a": 1}, {"b": 2}]))
    assert data.decode() == (
        '{\n "format": "test/thing",\n "version": 2,\n'
        f' "made_by": "eutree {eutree.__version__}",\n'
        ' "number": -0.0,\n "maybe": [5e-324,null],\n "rest": {},\n'
        ' "items": [\n  {"a":1},\n  {"b":2}\n ]\n}\n'
    )


@pytest.mark.promise(5)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_nothing_infinite_is_written(bad):
    for place, thing in {
        "number": Thing(number=bad),
        r"maybe\[1\]": Thing(number=1, maybe=[1, bad]),
        r"rest\.a\.b\[0\]": Thing(number=1, rest={"a": {"b": [bad]}}),
    }.items():
        with pytest.raises(InvalidArgumentError, match=f"{place} must be finite"):
            encode_document(thing)


def test_what_json_cannot_hold_is_refused():
    for bad in (object(), "\ud800", {1: object()}):
        with pytest.raises(InvalidArgumentError, match="cannot be written as JSON"):
            encode_document(Thing(number=1, rest={"a": bad}))
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(InvalidArgumentError, match="cannot be written as JSON"):
        encode_document(Thing(number=1, rest={"a": endless}))


HEAD = '{"format":"test/thing","version":2,"made_by":"eutree 0.1.0"'
BAD = {
    "": "truncated",
    "[]": "is not a thing file: Expected `object`",
    "{}": "is not a thing file: Object missing required field `format`",
    '{"format":"other","version":1,"made_by":"x","number":1}': "format: expected 'test/thing'",
    '{"format":"test/thing","version":3,"made_by":"eutree 2.1.0"}': (
        "version: made by eutree 2.1.0 as version 3 of test/thing; this is eutree "
    ),
    '{"format":"test/thing","version":0,"made_by":"x","number":1}': "version: must be at least 1",
    HEAD + "}": "missing required field `number`",
    HEAD + ',"number":NaN}': "byte 69: invalid character",
    HEAD + ',"number":Infinity}': "invalid character",
    HEAD + ',"number":1e999}': "number: Number out of range",
    HEAD + ',"number":"1"}': "number: Expected `float`, got `str`",
    HEAD + ',"number":1,"rest":{"a":1e999}}': "out of range",
    HEAD + ',"number":1,"number":2}': "number: the key stands twice",
    HEAD + ',"number":1,"rest":{"a":[{"b":1,"b":2}]}}': "b: the key stands twice",
    HEAD + ',"number":1,"more":2}': "unknown field `more`",
    HEAD + ',"number":1,"maybe":[1,"x"]}': r"maybe\[1\]: Expected `float \| null`",
    HEAD + ',"number":1,"rest":{"a":' + "[" * 100_000: "nested too deeply",
    HEAD + ',"number":1} x': "trailing",
    HEAD + ',"number":1,"rest":{"a":' + "9" * 5000 + "}}": "not JSON|range",
    HEAD + ',"number":1,"rest":{"a":"\\ud800"}}': "surrogate|truncated",
}


@pytest.mark.promise(2)
@pytest.mark.promise(6)
@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_anything_else_is_refused_with_place_and_reason(text, tmp_path):
    path = tmp_path / "thing.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=BAD[text]) as caught:
        read_document(path, Thing)
    assert str(path) in str(caught.value)
    assert caught.value.reason


@pytest.mark.promise(2)
def test_bad_utf_8_and_large_files_are_refused(tmp_path):
    path = tmp_path / "thing.json"
    path.write_bytes(HEAD.encode() + b',"number":1,"rest":{"a":"\xff"}}')
    with pytest.raises(FormatError, match=r"UTF-8|utf-8"):
        read_document(path, Thing)
    write_document(path, Thing(number=1))
    read_document(path, Thing, limit=path.stat().st_size)
    with pytest.raises(FormatError, match="too large"):
        read_document(path, Thing, limit=path.stat().st_size - 1)


@pytest.mark.promise(2)
@given(st.binary(max_size=300) | st.text(max_size=300).map(str.encode))
def test_any_bytes_end_in_a_thing_or_a_format_error(data):
    for content in (data, HEAD.encode() + data, HEAD.encode() + b',"number":1' + data):
        try:
            decode_document(content, Thing, "f")
        except FormatError:
            continue


def test_messages_do_not_repeat_a_files_control_characters():
    data = HEAD.replace("test/thing", "\\u001b[2J\\n").encode() + b"}"
    with pytest.raises(FormatError) as caught:
        decode_document(data, Thing, "f")
    assert str(caught.value).isprintable()
    with pytest.raises(FormatError, match=r"\\n: the key stands twice"):
        decode_document(HEAD.encode() + b',"number":1,"rest":{"\\n":1,"\\n":2}}', Thing, "f")
