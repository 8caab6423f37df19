"""Every message of the C codec, both ways, against pymavlink: the same octets for the same values."""

from __future__ import annotations

import ctypes
import functools
import math
import random
import struct
from pathlib import Path
from typing import Any

import pytest

from firmware.tools import generate_codec
from flightstack.mavlink.dialect import mavlink
from tests.firmware.codec_support import (
    KINDS,
    LARGEST_FRAME,
    LARGEST_PAYLOAD,
    NAMES,
    SOURCES,
    WARNINGS,
    c_name,
    compile_c,
    load,
    octets,
    parse,
    sealed,
    trimmed,
)

C_TYPES = {
    "char": ctypes.c_uint16,
    "uint8_t": ctypes.c_uint16,
    "uint16_t": ctypes.c_uint16,
    "int16_t": ctypes.c_int16,
    "uint32_t": ctypes.c_uint32,
    "int32_t": ctypes.c_int32,
    "uint64_t": ctypes.c_uint64,  # {low, high} on a little-endian host; aligned to 4, see c_struct
    "float": ctypes.c_uint32,  # its bits: a NaN would not survive Python's float
}
WORDS = (0, 0x80000000, 0x7F800000, 0xFF800000, 0x7FC00000, 0x7F800001, 0xFFFFFFFF, 0x7F7FFFFF, 1, 0x80000001)
"""Bits of +0, -0, infinities, a quiet and a signalling NaN, all ones, the largest float, the smallest denormals."""


@pytest.fixture(scope="module")
def codec(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load(tmp_path_factory.mktemp("codec"))


@functools.cache
def c_struct(kind: Any) -> type[ctypes.Structure]:
    """Return a message's structure as the header promises it: fields in the XML's order."""
    fields: list[tuple[str, Any]] = []
    for name in kind.fieldnames:
        at = kind.ordered_fieldnames.index(name)
        c_type = C_TYPES[kind.fieldtypes[kind.fieldnames.index(name)]]
        if c_type is ctypes.c_uint64:
            c_type = ctypes.c_uint32 * 2
        length = kind.array_lengths[at]
        fields.append((name, c_type * length if length else c_type))
    return type(kind.msgname, (ctypes.Structure,), {"_fields_": fields})


def wire_fields(kind: Any, payload: bytes) -> dict[str, bytes]:
    """Return the octets of each field in a whole payload, by the layout that pymavlink has."""
    out, at = {}, 0
    for name in kind.ordered_fieldnames:
        index = kind.ordered_fieldnames.index(name)
        c_type = kind.fieldtypes[kind.fieldnames.index(name)]
        size = {"char": 1, "uint8_t": 1, "uint16_t": 2, "int16_t": 2, "uint64_t": 8}.get(c_type, 4)
        size *= max(1, kind.array_lengths[index])
        out[name] = payload[at : at + size]
        at += size
    assert at == kind.unpacker.size
    return out


def in_memory(kind: Any, name: str, wire: bytes, rubbish: int = 0) -> bytes:
    """Return what a field looks like in the C structure; an octet's high bits hold ``rubbish``."""
    if kind.fieldtypes[kind.fieldnames.index(name)] in {"char", "uint8_t"}:
        return b"".join(struct.pack("<H", octet | rubbish) for octet in wire)
    return wire


def structure(kind: Any, payload: bytes, rubbish: int = 0) -> ctypes.Structure:
    """Return the structure that holds a payload's values."""
    made = c_struct(kind)()
    for name, wire in wire_fields(kind, payload).items():
        memory = in_memory(kind, name, wire, rubbish)
        field = getattr(type(made), name)
        assert field.size == len(memory)
        ctypes.memmove(ctypes.addressof(made) + field.offset, memory, field.size)
    return made


def payloads(kind: Any, count: int) -> list[bytes]:
    """Return payloads of extreme and of random bits."""
    rng, size = random.Random(kind.id), kind.unpacker.size
    made = [bytes(size), b"\xff" * size, b"\x80" * size, b"\x7f" * size, b"\x01" + bytes(size - 1)]
    for _ in range(count):
        words = b"".join(struct.pack("<I", rng.choice(WORDS)) for _ in range(size // 4 + 1))
        made.append(rng.choice([rng.randbytes(size), words[:size]]))
        cut = rng.randrange(size + 1)
        made.append(made[-1][:cut] + bytes(size - cut))
    return made


def test_the_generated_files_are_fresh() -> None:
    assert [
        path.name for path, text in generate_codec.files().items() if path.read_text("utf-8") != text
    ] == []
    assert sorted(generate_codec.MESSAGES) == sorted(NAMES)
    assert len(KINDS) == len(NAMES)


def test_a_field_that_the_c_code_cannot_move_is_refused_when_generating() -> None:
    message = next(
        m for m in generate_codec.parsed(generate_codec.SOURCES[-1]).message if m.name == "FS_PLANT_STATE"
    )
    with pytest.raises(ValueError, match=r"no function for double\[3\] position_ned_m"):
        generate_codec.struct_source(message)


@pytest.mark.parametrize("message_id", sorted(KINDS), ids=lambda number: KINDS[number].msgname)
def test_decoded_values_are_those_on_the_wire(codec: ctypes.CDLL, message_id: int) -> None:
    """For any bits, at any length that arrives, whatever the high bits of the octets hold."""
    kind = KINDS[message_id]
    rng = random.Random(1)
    decode = getattr(codec, f"{c_name(kind.msgname)}_decode")
    for payload in payloads(kind, 60):
        short = payload[: rng.choice([len(payload), len(trimmed(payload)), rng.randrange(len(payload) + 1)])]
        poisoned = (ctypes.c_uint16 * LARGEST_PAYLOAD)(*(octet | rng.randrange(256) << 8 for octet in short))
        poisoned[len(short) :] = [0xA5A5] * (LARGEST_PAYLOAD - len(short))  # must not be looked at
        memory = bytearray(b"\x5a" * (ctypes.sizeof(c_struct(kind)) + 16))
        made = c_struct(kind).from_buffer(memory)
        decode(poisoned, len(short), ctypes.byref(made))
        assert memory[ctypes.sizeof(made) :] == b"\x5a" * 16  # nothing is written behind the structure
        whole = short + bytes(len(payload) - len(short))
        for name, wire in wire_fields(kind, whole).items():
            field = getattr(type(made), name)
            value = bytes(memory[field.offset : field.offset + field.size])
            assert value == in_memory(kind, name, wire), (name, short.hex())


@pytest.mark.parametrize("message_id", sorted(KINDS), ids=lambda number: KINDS[number].msgname)
def test_encoded_octets_are_the_values_bits_without_zeros_at_the_end(
    codec: ctypes.CDLL, message_id: int
) -> None:
    kind = KINDS[message_id]
    encode = getattr(codec, f"{c_name(kind.msgname)}_encode")
    for payload in payloads(kind, 60):
        out = (ctypes.c_uint16 * LARGEST_PAYLOAD)(*([0xA5A5] * LARGEST_PAYLOAD))
        length = encode(ctypes.byref(structure(kind, payload, rubbish=0xC300)), out)
        assert octets(out, length) == trimmed(payload)
        assert set(out[kind.unpacker.size :]) <= {0xA5A5}


@pytest.mark.parametrize("message_id", sorted(KINDS), ids=lambda number: KINDS[number].msgname)
def test_frames_are_pymavlinks(codec: ctypes.CDLL, message_id: int) -> None:
    """pymavlink makes the same frame of the same values, and reads them out of the C codec's frame."""
    kind, rng, compared = KINDS[message_id], random.Random(2), 0
    for payload in payloads(kind, 60):
        values = pymavlink_values(kind, payload)
        if any(isinstance(v, float) and not math.isfinite(v) for v in flat(values)):
            continue  # pymavlink passes NaN through Python's float, which changes its bits
        sequence, system, component = rng.randrange(256), rng.randrange(256), rng.randrange(256)
        sender = mavlink.MAVLink(None, system, component)
        sender.seq = sequence
        expected = bytes(kind(*(values[name] for name in kind.fieldnames)).pack(sender))

        content, out = (ctypes.c_uint16 * LARGEST_PAYLOAD)(), rubbish_frame()
        length = getattr(codec, f"{c_name(kind.msgname)}_encode")(
            ctypes.byref(structure(kind, payload)), content
        )
        poisoned = (ctypes.c_uint16 * LARGEST_PAYLOAD)(*(octet | 0x9600 for octet in content))
        id_c = ctypes.c_uint32(kind.id)
        size = codec.fs_frame_encode(
            out, id_c, sequence | 0x100, system | 0x200, component | 0xFF00, poisoned, length
        )
        assert octets(out, size) == expected

        read = mavlink.MAVLink(None).parse_char(expected)
        assert (read.get_type(), read.get_seq(), read.get_srcSystem()) == (kind.msgname, sequence, system)
        compared += 1
    assert compared >= 15


def rubbish_frame() -> Any:
    """Return room for a frame in which every octet has to be written."""
    return (ctypes.c_uint16 * LARGEST_FRAME)(*([0xA5A5] * LARGEST_FRAME))


def pymavlink_values(kind: Any, payload: bytes) -> dict[str, Any]:
    """Return the values of a payload as pymavlink's constructors take them."""
    flat_values, values, at = kind.unpacker.unpack(payload), {}, 0
    for index, name in enumerate(kind.ordered_fieldnames):
        c_type = kind.fieldtypes[kind.fieldnames.index(name)]
        count = 1 if c_type == "char" else max(1, kind.array_lengths[index])
        taken = flat_values[at : at + count]
        values[name] = list(taken) if kind.array_lengths[index] and c_type != "char" else taken[0]
        at += count
    return values


def flat(values: dict[str, Any]) -> list[Any]:
    return [v for value in values.values() for v in (value if isinstance(value, list) else [value])]


def test_every_message_id_and_only_those_are_known(codec: ctypes.CDLL) -> None:
    kind_of, kind = codec.fs_message_kind_of, (ctypes.c_uint16 * 2)()
    for message_id in [*range(600), *range(52_900, 53_100), 0x10000, 0x10000 + 53_010, 0xFFFFFF]:
        known = kind_of(ctypes.c_uint32(message_id), kind)
        assert known == (message_id in KINDS)
        if known:
            assert tuple(kind) == (KINDS[message_id].unpacker.size, KINDS[message_id].crc_extra)


@pytest.mark.parametrize(("message_id", "length"), [(0, 256), (0, 65_535), (30, 4), (0x10000, 4)])
def test_what_cannot_be_a_frame_is_not_written(codec: ctypes.CDLL, message_id: int, length: int) -> None:
    out = rubbish_frame()
    payload = (ctypes.c_uint16 * LARGEST_PAYLOAD)()
    assert codec.fs_frame_encode(out, ctypes.c_uint32(message_id), 0, 1, 1, payload, length) == 0
    assert set(out) == {0xA5A5}


@pytest.mark.parametrize("length", [0, 1, 9, 254, 255])
def test_a_frame_of_any_length_finds_its_way_back(codec: ctypes.CDLL, length: int) -> None:
    payload = bytes(range(1, length + 1))
    out = rubbish_frame()
    size = codec.fs_frame_encode(out, 0, 9, 8, 7, (ctypes.c_uint16 * LARGEST_PAYLOAD)(*payload), length)
    assert octets(out, size) == sealed(0, payload, sender=b"\x09\x08\x07")
    (found,), summary = parse(codec, octets(out, size))
    assert (found.sequence, found.system, found.component, found.payload) == (9, 8, 7, payload)
    assert (summary.held, summary.skipped) == (0, 0)


@pytest.mark.parametrize("bits", [word for word in WORDS if word & 0x7FFFFFFF <= 0x7F800000])
def test_a_floats_bits_survive(codec: ctypes.CDLL, bits: int) -> None:
    (value,) = struct.unpack("<f", struct.pack("<I", bits))
    assert codec.fs_float_bits(value) == bits
    assert struct.pack("<f", codec.fs_bits_float(bits)) == struct.pack("<I", bits)


@pytest.mark.parametrize(
    ("payload", "length"), [(b"\0\0\0", 1), (b"\1\0\0", 1), (b"\0\0\1", 3), (b"\0\2\0", 2)]
)
def test_trimming_looks_at_eight_bits_and_leaves_one_octet(
    codec: ctypes.CDLL, payload: bytes, length: int
) -> None:
    poisoned = (ctypes.c_uint16 * 3)(*(octet | 0x7700 for octet in payload))
    assert codec.fs_trimmed(poisoned, 3) == length == len(trimmed(payload))


@pytest.mark.parametrize("text", ["", "FS_MASS", "ATT_REF_BW_LIMIT", "a text that is longer than its field"])
def test_text_fills_its_field_and_comes_back(codec: ctypes.CDLL, text: str) -> None:
    field, out = (ctypes.c_uint16 * 17)(*([0xA5A5] * 17)), ctypes.create_string_buffer(b"x" * 17, 17)
    codec.fs_text_put(field, 16, text.encode())
    assert octets(field, 16) == text.encode()[:16].ljust(16, b"\0")
    assert field[16] == 0xA5A5
    codec.fs_text_get((ctypes.c_uint16 * 16)(*(octet | 0x4200 for octet in field[:16])), 16, out)
    assert out.raw == text.encode()[:16].ljust(17, b"\0")


def test_text_beyond_ascii_is_marked(codec: ctypes.CDLL) -> None:
    out = ctypes.create_string_buffer(6)
    codec.fs_text_get((ctypes.c_uint16 * 5)(*b"a\x7f\x80\xff"), 5, out)
    assert out.raw == b"a\x7f??\0\0"
    field = (ctypes.c_uint16 * 3)()
    codec.fs_text_put(field, 3, b"\xc3\xa9")  # a char may be signed
    assert octets(field, 3) == b"\xc3\xa9\0"


def test_the_shim_of_the_tests_knows_every_message(codec: ctypes.CDLL) -> None:
    out, payload = (ctypes.c_uint16 * LARGEST_PAYLOAD)(), (ctypes.c_uint16 * LARGEST_PAYLOAD)(*([1] * 255))
    lengths = {i: codec.codec_recode(ctypes.c_uint32(i), payload, 255, out) for i in KINDS}
    assert lengths == {i: kind.unpacker.size for i, kind in KINDS.items()}


def test_the_objects_own_no_memory(tmp_path: Path) -> None:
    """No .data, no .bss, no common symbol: all state is the caller's."""
    for source in SOURCES:
        compile_c(tmp_path / "part.o", [source], "-c", "-O2", *WARNINGS)
        owned = [
            name
            for name, size in sections(tmp_path / "part.o")
            if size and name in {".data", ".bss", "COMMON"}
        ]
        assert owned == [], source.name


def sections(path: Path) -> list[tuple[str, int]]:
    """Return name and size of an ELF64 object's sections, those with data of thread or relocation as .data."""
    data = path.read_bytes()
    assert data[:5] == b"\x7fELF\x02"
    (table,) = struct.unpack_from("<Q", data, 0x28)
    entry, count, names = struct.unpack_from("<HHH", data, 0x3A)
    rows = [struct.unpack_from("<IIQQQQ", data, table + entry * i) for i in range(count)]
    text_at = rows[names][4]
    out = []
    for name_at, kind, flags, _, _, size in rows:
        name = data[text_at + name_at : data.index(b"\0", text_at + name_at)].decode()
        writable = flags & 1 and kind in {1, 8}
        out.append((".data" if writable else name, size))
    return out
