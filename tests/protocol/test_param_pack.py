"""The file ``@PARAM/param.pck``, read by MAVProxy's and pymavlink's own decoders and by ours."""

from __future__ import annotations

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavftp

from flightstack.mavlink.param_pack import pack_file, pack_parameters, unpack_parameters
from flightstack.params.store import ParamStore
from tests.protocol.param_harness import spec, store_of

NAME = st.text("ABC_1", min_size=1, max_size=16)


def told(data: bytes) -> list[tuple[str, float, float, bool]]:
    return [tuple(parameter) for parameter in unpack_parameters(data)]


def decode_as_pymavlink(data: bytes) -> tuple[list[tuple[bytes, float, int]], object]:
    decoded = mavftp.MAVFTP.ftp_param_decode(data)
    assert decoded is not None
    return decoded.params, decoded.defaults


def expected(store: ParamStore) -> list[tuple[str, float, float, bool]]:
    return [
        (name, as_float32(store.value(name)), as_float32(declared.default), declared.is_integer)
        for name, declared in store.specs.items()
    ]


def as_float32(value: float) -> float:
    (narrow,) = struct.unpack("<f", struct.pack("<f", value))
    return float(narrow)


@pytest.fixture
def store() -> ParamStore:
    store = store_of(60)
    for name in list(store.specs)[::4]:
        assert store.set(name, 7) is None
    return store


def test_the_header_and_first_entries_are_as_the_format_has_them() -> None:
    store = ParamStore([spec("AB_C", 1, 0, 9, True), spec("AB_DE", 0.5, 0, 9)])
    assert store.set("AB_DE", 2.5) is None
    assert pack_file(store, "") == (
        struct.pack("<HHH", 0x671B, 2, 2)
        + bytes((3, 3 << 4)) + b"AB_C" + struct.pack("<i", 1)
        + bytes((4, 3 | 1 << 4)) + b"DE" + struct.pack("<f", 2.5)
    )  # fmt: skip
    assert pack_file(store, "withdefaults=1") == (
        struct.pack("<HHH", 0x671C, 2, 2)
        + bytes((3, 3 << 4)) + b"AB_C" + struct.pack("<i", 1)
        + bytes((4 | 1 << 4, 3 | 1 << 4)) + b"DE" + struct.pack("<ff", 2.5, 0.5)
    )  # fmt: skip


def test_pymavlink_reads_it(store: ParamStore) -> None:
    params, defaults = decode_as_pymavlink(pack_file(store, "withdefaults=1") or b"")
    assert [(name.decode(), value) for name, value, _ in params] == [row[:2] for row in expected(store)]
    assert isinstance(defaults, list)
    assert [value for _, value, _ in defaults] == [row[2] for row in expected(store)]
    params, defaults = decode_as_pymavlink(pack_file(store, "") or b"")
    assert len(params) == 60
    assert defaults is None


def test_mavproxy_reads_it(store: ParamStore) -> None:
    param_ftp = pytest.importorskip("MAVProxy.modules.lib.param_ftp")
    decoded = param_ftp.ftp_param_decode(pack_file(store, "withdefaults=1"))
    assert [(name.decode(), value) for name, value, _ in decoded.params] == [
        row[:2] for row in expected(store)
    ]
    assert [value for _, value, _ in decoded.defaults] == [row[2] for row in expected(store)]


def test_a_part_is_told_with_the_whole_count(store: ParamStore) -> None:
    data = pack_file(store, "start=10&count=5&withdefaults=1")
    assert data is not None
    assert struct.unpack_from("<HHH", data) == (0x671C, 5, 60)
    assert told(data) == expected(store)[10:15]
    assert told(pack_file(store, "start=58&count=9") or b"") == [
        (name, value, value, kind) for name, value, _, kind in expected(store)[58:]
    ]


@pytest.mark.parametrize(
    "arguments",
    ["start=60", "start=65535", "count=99999", "start=-1", "start=x", "withdefaults=2", "start=", "start=²"],
)
def test_bad_arguments_make_no_file(store: ParamStore, arguments: str) -> None:
    assert pack_file(store, arguments) is None


def test_unknown_arguments_are_ignored(store: ParamStore) -> None:
    assert pack_file(store, "colour=red") == pack_file(store, "")


@given(
    st.dictionaries(NAME, st.tuples(st.floats(-100, 100, width=32), st.booleans()), min_size=1, max_size=30)
)
def test_any_set_of_names_comes_back(parameters: dict[str, tuple[float, bool]]) -> None:
    store = ParamStore(
        spec(name, int(value) if is_integer else value, -100, 100, is_integer)
        for name, (value, is_integer) in parameters.items()
    )
    data = pack_parameters(store)
    assert data is not None
    assert told(data) == expected(store)
    params, _ = decode_as_pymavlink(data)
    assert [(name.decode(), value) for name, value, _ in params] == [row[:2] for row in expected(store)]


@given(st.binary(max_size=60), st.booleans())
def test_bytes_that_are_no_such_file_are_refused(junk: bytes, has_header: bool) -> None:
    data = struct.pack("<HHH", 0x671B, 5, 5) + junk if has_header else junk
    with suppress(ValueError):  # and nothing else
        list(unpack_parameters(data))


def test_a_cut_file_is_refused(store: ParamStore) -> None:
    data = pack_file(store, "") or b""
    for size in (0, 5, 6, 7, len(data) - 1):
        with pytest.raises(ValueError, match="parameter file"):
            list(unpack_parameters(data[:size]))
