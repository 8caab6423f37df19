"""Build the codec for tests, and make streams for its parser."""

from __future__ import annotations

import ctypes
import functools
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

from flightstack.mavlink.dialect import mavlink
from tests.support.tools import missing

ROOT = Path(__file__).resolve().parents[2]
CODEC = ROOT / "firmware" / "mavlink"
HARNESS = Path(__file__).parent / "c"
SOURCES = sorted(CODEC.glob("*.c"))
WARNINGS = [
    *(
        "-std=c99",
        "-ffp-contract=off",
        "-fno-fast-math",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wdouble-promotion",
    ),
    *("-Wshadow", "-Wstrict-prototypes", "-Werror"),
]
NAMES = [
    *(
        "HEARTBEAT",
        "PING",
        "PARAM_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "PARAM_VALUE",
        "PARAM_SET",
        "PARAM_ERROR",
    ),
    *("COMMAND_LONG", "COMMAND_ACK", "AUTOPILOT_VERSION", "STATUSTEXT"),
    *(
        "FS_PIL_STEP",
        "FS_PIL_REPORT",
        "FS_PIL_STATUS",
        "FS_PIL_IDENTITY",
        "FS_PIL_TICK",
        "FS_PIL_OUTPUT",
        "FS_PIL_STATE",
        "FS_PIL_DRIVE",
        "FS_PIL_TIMING",
        "FS_PIL_SENSE",
        "FS_PIL_ESTIMATE",
        "FS_PIL_MEMORY",
    ),
]
KINDS: dict[int, Any] = {kind.id: kind for kind in mavlink.mavlink_map.values() if kind.msgname in NAMES}
"""The messages of the codec, as pymavlink has them."""

LARGEST_FRAME, LARGEST_PAYLOAD = 280, 255


def compiler(wanted: str | None = None) -> list[str]:
    """Return the command of a C compiler: the wanted one, or any; skips the test when there is none."""
    if wanted is None:
        for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
            if name and shutil.which(name):
                return [name]
        probe = subprocess.run([sys.executable, "-m", "ziglang", "version"], check=False, capture_output=True)
        if probe.returncode == 0:
            return [sys.executable, "-m", "ziglang", "cc"]
    elif shutil.which(wanted):
        return [wanted]
    return missing(f"no {wanted or 'C compiler'} on this machine")


@functools.cache
def filled_stack() -> tuple[str, ...]:
    """Return the flag that fills variables without a value, so that tests find one that is read; empty if unknown."""
    flag = "-ftrivial-auto-var-init=pattern"
    command = [*compiler(), flag, "-fsyntax-only", "-x", "c", os.devnull]
    return (flag,) if subprocess.run(command, check=False, capture_output=True).returncode == 0 else ()


def compile_c(output: Path, sources: list[Path], *flags: str, cc: list[str] | None = None) -> Path:
    """Compile and link sources into ``output``; the compiler's words are the failure."""
    command = [
        *(cc or compiler()),
        *flags,
        f"-I{CODEC}",
        f"-I{HARNESS}",
        "-o",
        str(output),
        *map(str, sources),
    ]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return output


def c_name(name: str) -> str:
    """Return the name of a message's structure in C."""
    return "fs_" + {"PARAM_SET": "param_set_message"}.get(name, name.lower().removeprefix("fs_"))


def load(folder: Path) -> ctypes.CDLL:
    """Build the codec and the shim as a library, and tell ctypes what its functions return."""
    sources = [*SOURCES, HARNESS / "codec_shim.c"]
    path = compile_c(folder / "codec.so", sources, "-shared", "-fPIC", "-O2", *filled_stack(), *WARNINGS)
    library = ctypes.CDLL(str(path))
    encoders = [f"{c_name(name)}_encode" for name in NAMES]
    for name in ("fs_message_kind_of", "fs_frame_encode", "fs_trimmed", "codec_recode", *encoders):
        getattr(library, name).restype = ctypes.c_uint16  # above, the register holds rubbish
    library.fs_bits_float.restype, library.fs_bits_float.argtypes = ctypes.c_float, [ctypes.c_uint32]
    library.fs_float_bits.restype, library.fs_float_bits.argtypes = ctypes.c_uint32, [ctypes.c_float]
    return library


class CFrame(ctypes.Structure):
    """fs_frame."""

    _fields_ = [
        ("id", ctypes.c_uint32),
        *((name, ctypes.c_uint16) for name in ("system", "component", "sequence", "length")),
        ("payload", ctypes.c_uint16 * LARGEST_PAYLOAD),
    ]


class CFound(ctypes.Structure):
    """codec_found."""

    _fields_ = [
        ("frame", CFrame),
        ("recoded_length", ctypes.c_uint16),
        ("recoded", ctypes.c_uint16 * LARGEST_PAYLOAD),
    ]


class Summary(ctypes.Structure):
    """codec_summary."""

    _fields_ = [
        (name, ctypes.c_uint32) for name in ("found", "flushed", "good", "bad", "unknown", "skipped", "held")
    ]


class Found(NamedTuple):
    """A frame out of the C parser."""

    id: int
    sequence: int
    system: int
    component: int
    payload: bytes
    recoded: bytes
    """The payload after it was decoded and encoded again."""


def octets(array: Any, count: int) -> bytes:
    """Return the first elements of an array of fs_octet; ValueError when one has more than 8 bits."""
    return bytes(array[:count])


def parse(
    library: ctypes.CDLL, stream: bytes, eager: bool = True, poisoned: bool = False, flush: bool = False
) -> tuple[list[Found], Summary]:
    """Return what the C parser finds in a stream."""
    room = len(stream) // 8 + 1
    out, summary = (CFound * room)(), Summary()
    library.codec_parse(stream, len(stream), eager, poisoned, flush, out, room, ctypes.byref(summary))
    frames = [
        Found(
            one.frame.id,
            one.frame.sequence,
            one.frame.system,
            one.frame.component,
            octets(one.frame.payload, one.frame.length),
            octets(one.recoded, one.recoded_length),
        )
        for one in out[: summary.found]
    ]
    return frames, summary


def trimmed(payload: bytes) -> bytes:
    """Return a payload as MAVLink 2 sends it."""
    return payload.rstrip(b"\0") or b"\0"


def sealed(
    message_id: int, payload: bytes, version: int = 2, signed: bool = False, sender: bytes = b"\x07\xfe\xbe"
) -> bytes:
    """Return a frame around any payload; ``sender`` is sequence, system, component."""
    kind = mavlink.mavlink_map.get(message_id)
    if version == 1:
        body = bytes([len(payload)]) + sender + bytes([message_id]) + payload
    else:
        body = bytes([len(payload), signed, 0]) + sender + message_id.to_bytes(3, "little") + payload
    checksum = mavlink.x25crc(body)
    checksum.accumulate(bytes([0 if kind is None else kind.crc_extra]))
    tail = checksum.crc.to_bytes(2, "little") + (b"\xfd\xfe" + bytes(11) if signed else b"")
    return (b"\xfe" if version == 1 else b"\xfd") + body + tail


def any_frame(rng: random.Random) -> bytes:
    """Return a whole frame: known or unknown, of either version, signed or not, short or too long."""
    signed, version = rng.random() < 0.15, 1 if rng.random() < 0.2 else 2
    if rng.random() < 0.1:
        return sealed(
            rng.choice([1, 30, 33, 65, 54321, 0xFDFDFE]), rng.randbytes(rng.randrange(40)), 2, signed
        )
    kind = rng.choice([k for k in KINDS.values() if version == 2 or k.id < 256])
    payload = bytearray(rng.randbytes(kind.unpacker.size))
    if rng.random() < 0.3:  # full of beginnings of frames
        payload = bytearray(rng.choice(b"\xfd\xfe\x00\x01\x09") for _ in payload)
    if version == 2:
        payload = payload[: rng.randint(0, len(payload))] if rng.random() < 0.5 else payload
        payload += rng.randbytes(5) if rng.random() < 0.05 else b""
    return sealed(kind.id, bytes(payload), version, signed and version == 2, rng.randbytes(3))


def damaged(rng: random.Random, frame: bytes) -> bytes:
    """Return a frame as a bad line passes it on."""
    data = bytearray(frame)
    at = rng.randrange(len(data))
    match rng.randrange(5):
        case 0:
            data[at] ^= 1 << rng.randrange(8)
        case 1:
            del data[at]
        case 2:
            data.insert(at, rng.choice([0xFD, 0xFE, rng.randrange(256)]))
        case 3:
            del data[at:]
        case _:
            data[at] = data[min(at + 1, len(data) - 1)]
    return bytes(data)


@functools.cache
def stream(seed: int, parts: int) -> bytes:
    """Return frames, damaged frames and noise."""
    rng = random.Random(seed)
    made = []
    for _ in range(parts):
        what = rng.random()
        if what < 0.6:
            made.append(any_frame(rng))
        elif what < 0.85:
            made.append(damaged(rng, any_frame(rng)))
        elif what < 0.95:
            made.append(rng.randbytes(rng.randrange(40)))
        else:
            made.append(bytes(rng.choice(b"\xfd\xfe\x00\x01") for _ in range(rng.randrange(300))))
    return b"".join(made)
