"""All parameters in one file, ``@PARAM/param.pck``, in the format of ArduPilot's AP_Filesystem_Param.

MAVProxy and QGroundControl download it over MAVFTP instead of the parameter list. It has a header of three
little-endian uint16 (magic, parameters in this file, parameters in total) and for each parameter, in order of names:

* type in the low four bits (3: int32, 4: float32), flags in the high ones (bit 0: a default follows the value);
* number of letters shared with the previous name in the low four bits, number of further letters less one in the high
  ones;
* the further letters; the value; the default, if it differs and was requested.

ArduPilot pads with zeros so that no changing value crosses a block; this file is a snapshot without padding.
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
    """Arguments after the ``?`` of the file name."""

    start: int = 0
    limit: int = 0
    """Maximum number of parameters; 0 for all from ``start`` on."""
    with_defaults: bool = False


class PackedParameter(NamedTuple):
    """One parameter in the file; ``default`` equals the value if the file has none."""

    name: str
    value: float
    default: float
    is_integer: bool


def parse_pack_request(arguments: str) -> PackRequest | None:
    """Parse ``start=N&count=N&withdefaults=1``, ignoring unknown arguments; None for a bad one."""
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
    """Return the file for the arguments after the ``?`` of its name; None for bad arguments."""
    request = parse_pack_request(arguments)
    return None if request is None else pack_parameters(store, request)


def pack_parameters(store: ParamStore, request: PackRequest = PackRequest()) -> bytes | None:  # noqa: B008  (immutable)
    """Return the file; None without a parameter at ``request.start``."""
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
    """Yield the parameters of a file; raise ValueError for an invalid or truncated file."""
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
            raise ValueError("the parameter file is truncated")
        kind, lengths = data[at], data[at + 1]
        codec = {_TYPE_INT32: _INT, _TYPE_FLOAT: _FLOAT}.get(kind & 0xF)
        if codec is None:
            raise ValueError(f"parameter type {kind & 0xF} is not supported")
        value_at = at + 3 + (lengths >> 4)
        at = value_at + codec.size * (2 if kind & _HAS_DEFAULT else 1)
        if at > len(data):
            raise ValueError("the parameter file is truncated")
        before = before[: lengths & 0xF] + data[value_at - 1 - (lengths >> 4) : value_at]
        value = float(codec.unpack_from(data, value_at)[0])
        default = float(codec.unpack_from(data, at - codec.size)[0])
        yield PackedParameter(before.decode("ascii", errors="replace"), value, default, codec is _INT)
