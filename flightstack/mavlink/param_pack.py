"""All parameters in one small file, ``@PARAM/param.pck``: the format of ArduPilot's AP_Filesystem_Param.

MAVProxy and QGroundControl fetch it over MAVFTP in place of a list. A header of three little-endian uint16 (magic,
parameters in this file, parameters in all), and for each parameter, in the order of names:

* type in the low four bits (3: int32, 4: float32), flags in the high ones (bit 0: a default follows the value);
* letters shared with the name before in the low four bits, number of the other letters less one in the high ones;
* the other letters; the value; the default, if it differs and was asked for.

ArduPilot pads with zeros so that no value crosses a block while it changes; ours is a snapshot and needs none.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

from flightstack.params.store import ParamStore

MAGIC, MAGIC_WITH_DEFAULTS = 0x671B, 0x671C
_HEADER = struct.Struct("<HHH")
_INT, _FLOAT = struct.Struct("<i"), struct.Struct("<f")
_TYPE_INT32, _TYPE_FLOAT = 3, 4
_HAS_DEFAULT = 0x10
_MOST_SHARED = 15


class PackRequest(NamedTuple):
    """What is asked for behind the ``?`` of the file's name."""

    start: int = 0
    limit: int = 0
    """Most parameters; 0: all from ``start`` on."""
    with_defaults: bool = False


class PackedParameter(NamedTuple):
    """One parameter in the file; ``default`` is the value itself when the file says nothing else."""

    name: str
    value: float
    default: float
    is_integer: bool


def parse_pack_request(arguments: str) -> PackRequest | None:
    """Read ``start=N&count=N&withdefaults=1``; unknown arguments are ignored, bad ones make None."""
    request = PackRequest()
    for part in arguments.split("&"):
        key, _, text = part.partition("=")
        if key not in ("start", "count", "withdefaults"):
            continue
        if not (text.isascii() and text.isdigit() and len(text) <= 5 and int(text) < 0xFFFF):
            return None
        if key == "withdefaults":
            if int(text) > 1:
                return None
            request = request._replace(with_defaults=text == "1")
        elif key == "start":
            request = request._replace(start=int(text))
        else:
            request = request._replace(limit=int(text))
    return request


def pack_file(store: ParamStore, arguments: str) -> bytes | None:
    """Return the file for what follows the ``?`` of its name; None when it asks for what there is not."""
    request = parse_pack_request(arguments)
    return None if request is None else pack_parameters(store, request)


def pack_parameters(store: ParamStore, request: PackRequest = PackRequest()) -> bytes | None:  # noqa: B008  (immutable)
    """Return the file; None when there is no parameter at ``request.start``."""
    names = sorted(store.specs)
    if request.start >= len(names):
        return None
    wanted = names[request.start :]
    if request.limit:
        wanted = wanted[: request.limit]
    magic = MAGIC_WITH_DEFAULTS if request.with_defaults else MAGIC
    parts = [_HEADER.pack(magic, len(wanted), len(names))]
    before = ""
    for name in wanted:
        parts.append(_entry(store, name, before, request.with_defaults))
        before = name
    return b"".join(parts)


def _entry(store: ParamStore, name: str, before: str, with_defaults: bool) -> bytes:
    spec = store.specs[name]
    value, default = (
        _INT.pack(int(number)) if spec.is_integer else _FLOAT.pack(number)
        for number in (store.value(name), spec.default)
    )
    differ = (index for index, letters in enumerate(zip(name, before, strict=False)) if len(set(letters)) > 1)
    shared = min(next(differ, len(before)), _MOST_SHARED, len(name) - 1)
    rest = name[shared:].encode("ascii")
    add_default = with_defaults and value != default
    kind = (_TYPE_INT32 if spec.is_integer else _TYPE_FLOAT) | (_HAS_DEFAULT if add_default else 0)
    head = bytes((kind, shared | (len(rest) - 1) << 4))
    return head + rest + value + (default if add_default else b"")


def unpack_parameters(data: bytes) -> Iterator[PackedParameter]:
    """Yield the parameters of a file; raise ValueError when it is none, or is cut."""
    if len(data) < _HEADER.size:
        raise ValueError("a parameter file has a header of 6 bytes")
    magic, count, _total = _HEADER.unpack_from(data)
    if magic not in (MAGIC, MAGIC_WITH_DEFAULTS):
        raise ValueError(f"0x{magic:04x} is not the beginning of a parameter file")
    at, before = _HEADER.size, b""
    for _ in range(count):
        while data[at : at + 1] == b"\0":  # padding
            at += 1
        if len(data) < at + 2:
            raise ValueError("the parameter file is cut short")
        kind, lengths = data[at], data[at + 1]
        codec = {_TYPE_INT32: _INT, _TYPE_FLOAT: _FLOAT}.get(kind & 0xF)
        if codec is None:
            raise ValueError(f"parameter type {kind & 0xF} is not supported")
        value_at = at + 3 + (lengths >> 4)
        at = value_at + codec.size * (2 if kind & _HAS_DEFAULT else 1)
        if at > len(data):
            raise ValueError("the parameter file is cut short")
        before = before[: lengths & 0xF] + data[value_at - 1 - (lengths >> 4) : value_at]
        value = float(codec.unpack_from(data, value_at)[0])
        default = float(codec.unpack_from(data, at - codec.size)[0])
        yield PackedParameter(before.decode("ascii", errors="replace"), value, default, codec is _INT)
