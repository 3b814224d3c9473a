"""Archives: equal content, equal bytes; nothing is allocated on a file's word."""

import io
import struct
import tracemalloc
import zipfile
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from eutree.errors import FileError, FormatError, InvalidArgumentError
from eutree.files import arrays as archives
from eutree.files.arrays import decode_archive, encode_archive, read_archive, write_archive
from eutree.files.documents import Document


class Note(Document, frozen=True, kw_only=True):
    FORMAT: ClassVar[str] = "test/note"
    text: str = ""


ALLOWED = sorted(archives.ELEMENT_TYPES)


@pytest.mark.promise(4)
@given(st.data(), st.sampled_from(ALLOWED))
def test_arrays_come_back_to_the_bit(data, element_type):
    array = data.draw(hnp.arrays(element_type, hnp.array_shapes(max_dims=4, min_side=0)))
    content = encode_archive({"a": array, "b": array.T}, Note(text="x"))
    note, back = decode_archive(content, Note, "f")
    assert note.text == "x"
    for name, expected in (("a", array), ("b", array.T)):
        assert back[name].dtype == expected.dtype
        assert back[name].shape == expected.shape
        assert back[name].tobytes() == expected.tobytes()
        assert not back[name].flags.writeable
    assert encode_archive(back, note) == content


def test_numpy_reads_ours_and_we_read_numpys(tmp_path):
    path = tmp_path / "a.npz"
    x, y = np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6).reshape(3, 2))
    archives.write_arrays(path, {"x": x, "y": y})
    with np.load(path, allow_pickle=False) as loaded:
        assert np.array_equal(loaded["x"], x)
        assert np.array_equal(loaded["y"], y)
    for save in (np.savez, np.savez_compressed):
        save(path, x=x, y=y, s=np.float32(3))
        back = archives.read_arrays(path)
        assert np.array_equal(back["x"], x)
        assert np.array_equal(back["y"], y)
        assert back["s"] == 3


def test_members_that_are_not_wanted_are_not_looked_at(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, x=np.zeros(2), infos=np.array([{}], dtype=object), names=np.array(["a"]))
    assert set(archives.read_arrays(path, only={"x"})) == {"x"}
    with pytest.raises(FormatError, match=r"infos.npy: element type '\|O' is not allowed"):
        archives.read_arrays(path, only={"infos"})
    with pytest.raises(FormatError, match="not allowed"):
        archives.read_arrays(path)


def test_only_plain_arrays_are_written(tmp_path):
    for bad in ({"a b": np.zeros(1)}, {"a": np.array([{}])}, {"a": np.array(["x"])}):
        with pytest.raises(InvalidArgumentError, match="array"):
            archives.write_arrays(tmp_path / "a.npz", bad)
    assert list(tmp_path.iterdir()) == []


def npy(header, body=b"", version=b"\1\0", length=None):
    text = header.encode("latin-1")
    size = struct.pack(
        "<H" if version == b"\1\0" else "<I", len(text) if length is None else length
    )
    return b"\x93NUMPY" + version + size + text + body


def zipped(members, compression=zipfile.ZIP_STORED):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return buffer.getvalue()


GOOD_HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }\n"
ATTACKS = {
    "not a zip": (b"PK\3\4 nothing", "archive"),
    "empty": (b"", "archive"),
    "name outside": (zipped([("../x.npy", npy(GOOD_HEADER, bytes(8)))]), "unexpected member"),
    "member": (zipped([("x.pkl", b"")]), "unexpected member"),
    "pickle": (zipped([("x.npy", b"\x80\x04K\x01.")]), "npy"),
    "object array": (
        zipped([("x.npy", npy(GOOD_HEADER.replace("<f8", "|O"), bytes(8)))]),
        "not allowed",
    ),
    "code in the header": (
        zipped([("x.npy", npy("__import__('os').system('echo hi')\n"))]),
        "npy header",
    ),
    "shape without data": (
        zipped([("x.npy", npy(GOOD_HEADER.replace("1,", "10000000000,")))]),
        "does not fit",
    ),
    "huge empty shape": (
        zipped([("x.npy", npy(GOOD_HEADER.replace("1,", "0, 999999999999999")))]),
        "not allowed",
    ),
    "five dimensions": (
        zipped([("x.npy", npy(GOOD_HEADER.replace("1,", "1, 1, 1, 1, 1"), bytes(8)))]),
        "not allowed",
    ),
    "header too long": (
        zipped([("x.npy", npy(GOOD_HEADER, version=b"\2\0", length=2**31))]),
        "npy",
    ),
    "truth value 2": (
        zipped([("x.npy", npy(GOOD_HEADER.replace("<f8", "|b1"), b"\2"))]),
        "neither 0 nor 1",
    ),
    "too many": (zipped([(f"x{i}.npy", npy(GOOD_HEADER, bytes(8))) for i in range(70)]), "members"),
    "lzma": (zipped([("x.npy", npy(GOOD_HEADER, bytes(8)))], zipfile.ZIP_LZMA), "compression"),
    "bomb": (lambda: zipped([("x.npy", bytes(2**29))], zipfile.ZIP_DEFLATED), "too large: unpacks"),
}


@pytest.mark.promise(2)
@pytest.mark.parametrize("name", ATTACKS)
def test_attacks_are_refused_before_memory_is_taken(name, tmp_path):
    content, message = ATTACKS[name]
    path = tmp_path / "a.npz"
    path.write_bytes(content() if callable(content) else content)  # the bomb takes seconds to make
    tracemalloc.start()
    with pytest.raises(FormatError, match=message):
        archives.read_arrays(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10_000_000


@pytest.mark.promise(2)
def test_however_high_the_cap_a_file_takes_no_more_than_twice_its_own_size(tmp_path):
    """A checkpoint may hold 4 GiB; a small file that declares so much must not get them."""
    path, huge = tmp_path / "a.npz", 4 * 2**30
    write_archive(path, Note(), {"x": np.zeros(2**20)})
    bomb = zipped([("x.npy", bytes(2**28))], zipfile.ZIP_DEFLATED)
    shape = npy(GOOD_HEADER.replace("(1,)", "(500000000,)"), bytes(8))
    tracemalloc.start()
    read_archive(path, Note, limit=huge)
    for content in (bomb, zipped([("document.json", b"{}"), ("x.npy", shape)])):
        with pytest.raises(FormatError):
            decode_archive(content, Note, path, limit=huge)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2.1 * path.stat().st_size


def test_what_could_not_be_read_is_not_written(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(FileError, match=r"bytes are more than the 1,000 allowed"):
        write_archive(path, Note(), {"x": np.zeros(1000)}, limit=1000)
    assert not path.exists()


@pytest.mark.promise(2)
def test_a_lie_about_the_size_is_found(tmp_path):
    content = bytearray(zipped([("x.npy", bytes(2**20))], zipfile.ZIP_DEFLATED))
    true, lie = struct.pack("<I", 2**20), struct.pack("<I", 100)
    assert content.count(true) == 2
    path = tmp_path / "a.npz"
    path.write_bytes(content.replace(true, lie))
    with pytest.raises(FormatError):
        archives.read_arrays(path)
    path.write_bytes(content.replace(true, struct.pack("<I", 2**27)))
    with pytest.raises(FormatError, match="declares 134217728 bytes but holds 1048576"):
        archives.read_arrays(path)


@pytest.mark.promise(2)
def test_a_member_twice_is_refused(tmp_path):
    with pytest.warns(UserWarning, match="Duplicate"):
        content = zipped([("x.npy", npy(GOOD_HEADER, bytes(8)))] * 2)
    with pytest.raises(FormatError, match="twice"):
        decode_archive(content, Note, "f")


def test_a_document_is_required_and_checked(tmp_path):
    path = tmp_path / "a.npz"
    archives.write_arrays(path, {"x": np.zeros(1)})
    with pytest.raises(FormatError, match=r"document\.json: missing"):
        read_archive(path, Note)
    write_archive(path, Note(text="hello"), {"x": np.zeros(1)})
    assert read_archive(path, Note)[0].text == "hello"
    with pytest.raises(FormatError, match="too large"):
        read_archive(path, Note, limit=100)
