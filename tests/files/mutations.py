"""Damage to files: flips, cuts, splices and repeats, also below checksums."""

import io
import struct
import zipfile
import zlib

from eutree.data.journal import MAGIC


def mutate(data, rng):
    """Return ``data`` with one to four random damages."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        kind, size = rng.randrange(6), len(data)
        at = rng.randrange(size + 1)
        length = min(rng.choice((1, 2, 4, 8, 64, 1000)), size - at)
        if kind == 0 and at < size:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at : at + length]
        elif kind == 2:
            source = rng.randrange(size + 1)
            data[at:at] = data[source : source + length]
        elif kind == 3:
            data[at : at + length] *= rng.choice((2, 3, 50))
        elif kind == 4:
            special = (
                b"\xff\xff\xff\xff",
                b"\0" * 8,
                b"-1",
                b"1e999",
                b"NaN",
                b"[" * 500,
                b"9" * 40,
            )
            data[at : at + length] = rng.choice(special)
        elif at < size:
            data[at] = rng.randrange(256)
    return bytes(data[: 2**20])


def mutate_members(data, rng):
    """Damage one member of an archive and pack it again, with checksums that are right."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    name = rng.choice(sorted(members))
    kind = rng.randrange(8)
    if kind == 0:
        del members[name]
    elif kind == 1:
        members[name] = members[rng.choice(sorted(members))]
    elif kind == 2:
        members[mutate(name.encode(), rng).decode("latin-1")] = members.pop(name)
    else:
        members[name] = mutate(members[name], rng)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(name.replace("\0", "")[:200] or "x", content)
    return buffer.getvalue()


def mutate_elements(data, rng):
    """Overwrite one to three elements of the arrays of an archive; all sizes stay right."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    for _ in range(rng.randint(1, 3)):
        name = rng.choice([name for name in sorted(members) if name.endswith(".npy")])
        content = bytearray(members[name])
        start = content.index(b"\n") + 1
        wide = rng.choice((1, 4, 8))
        if len(content) - start >= wide:
            at = start + rng.randrange((len(content) - start) // wide) * wide
            known = int.from_bytes(content[at : at + wide], "little")
            new = rng.choice((0, 1, known + 1, known - 1, 2 ** (8 * wide - 1), rng.getrandbits(64)))
            content[at : at + wide] = (new % 2 ** (8 * wide)).to_bytes(wide, "little")
        members[name] = bytes(content)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def mutate_records(data, rng):
    """Damage one record of a journal, with a checksum that is right."""
    records, place = [], len(MAGIC)
    while place < len(data):
        (length,) = struct.unpack_from("<I", data, place)
        records.append(data[place + 8 : place + 8 + length])
        place += 8 + length
    at = rng.randrange(len(records))
    kind = rng.randrange(6)
    if kind == 0:
        del records[at]
    elif kind == 1:
        records.insert(at, rng.choice(records))
    else:
        records[at] = mutate(records[at], rng)
    packed = (struct.pack("<II", len(r), zlib.crc32(r)) + r for r in records)
    return MAGIC + b"".join(packed)
