"""A view that is built when it is read equals the one that is folded after each message of pymavlink."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from random import Random
from typing import Any

import pytest

from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.mavlink.dialect import ardupilot_dialect, mavlink
from flightstack.mavlink.fields import TEXT_FIELDS, clean
from flightstack.mavlink.frames import MAGIC_V1, checksum, pack_frame
from flightstack.mavlink.link import Link
from gcs_cli.vehicle.status_texts import without_stale_piece
from gcs_cli.vehicle.vehicle_view import FOLDS, MEASUREMENTS, TIMES
from gcs_cli.vehicle.view_builder import ViewBuilder
from gcs_cli.vehicle.view_types import Identity, Vector, VehicleView, view_with

ardupilot_dialect()
_BY_NAME = {kind.msgname: kind for kind in mavlink.mavlink_map.values()}
_FAST = (
    "ATTITUDE",
    "ATTITUDE_TARGET",
    "LOCAL_POSITION_NED",
    "GLOBAL_POSITION_INT",
    "POSITION_TARGET_LOCAL_NED",
)
_FOLDED = [*sorted({*FOLDS, *MEASUREMENTS, *TIMES}), *_FAST * 4, "HEARTBEAT", "HEARTBEAT"]
_MODES = [CUSTOM_MODE[mode] for mode in (Mode.HOLD, Mode.MISSION, Mode.RETURN)]
_EXTREMES = (b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\0" * 4, b"\0\0\x80\x3f", b"\xff" * 4)
"""NaN, infinities, zero, one and the largest integer."""


def _payload(kind: Any, boot_ms: int, random: Random) -> bytes:
    """Return a payload of extreme and random values; heartbeats and times are plausible ones."""
    if kind.msgname == "HEARTBEAT":
        autopilot, base, state = (
            random.choice((12, 12, 3, 8)),
            random.choice((1, 129)),
            random.choice((3, 4, 7)),
        )
        return struct.pack("<IBBBBB", random.choice(_MODES), 2, autopilot, base, state, 3)
    size = kind.unpacker.size
    words = (random.choice(_EXTREMES) if random.random() < 0.5 else random.randbytes(4) for _ in range(size))
    payload = b"".join(words)[:size]
    if kind.ordered_fieldnames[0] == "time_boot_ms":
        payload = struct.pack("<I", boot_ms) + payload[4:]
    return payload[: random.randint(1, size)] if random.random() < 0.3 else payload


def _frames(random: Random) -> Iterator[tuple[bytes, float]]:
    """Yield the frames of a vehicle and of a second system with the times at which they are received."""
    now_s, sequence, boot_ms = 0.0, 0, 10_000
    for _ in range(600):
        now_s += random.choice((0.0, 0.001, 0.01, 0.3, 1.2))
        sequence = (sequence + random.choice((1, 1, 1, 1, 1, 0, 2, 5, 200))) % 256
        boot_ms += random.choice((1, 10, 20, 300, -5, -400))
        known = random.random() < 0.95
        kind = _BY_NAME[random.choice(_FOLDED)] if known else random.choice(list(_BY_NAME.values()))
        payload, system = _payload(kind, max(0, boot_ms), random), random.choice((1, 1, 1, 1, 1, 1, 2))
        if kind.id < 256 and random.random() < 0.3:
            body = bytes((len(payload), sequence, system, 1, kind.id)) + payload
            yield bytes((MAGIC_V1,)) + body + checksum(body, kind.crc_extra), now_s
        else:
            sent = payload.rstrip(b"\0") or b"\0"
            yield pack_frame(kind.id, sent, kind.crc_extra, sequence, system, 1), now_s


def _decoded_at_once(frame: bytes) -> Any:
    """Return pymavlink's message with texts that are safe to print."""
    message = mavlink.MAVLink(None, 255, 190).decode(bytearray(frame))
    for name in TEXT_FIELDS[type(message)]:
        setattr(message, name, clean(getattr(message, name)))
    return message


def _folded_at_once(view: VehicleView, message: Any, now_s: float) -> VehicleView:
    """Return the view after a message, but for the counts of the link: the builder's rules without its delays."""
    sender = message.get_srcSystem(), message.get_srcComponent()
    if (
        view.identity is None and message.get_type() == "HEARTBEAT" and message.autopilot != 8
    ):  # not of an autopilot
        view = view._replace(identity=Identity(*sender, message.type, message.autopilot))
    if view.identity is None or sender != view.identity[:2]:
        return view
    if view.partial_text is not None:
        view = view_with(view, without_stale_piece(view, now_s))
    name, changes = message.get_type(), {}
    if name in FOLDS:
        changes = FOLDS[name](view, message, now_s)
    elif name in MEASUREMENTS:
        changes = MEASUREMENTS[name](view, message)
    if name in TIMES:
        changes["time_s"] = message.time_boot_ms / 1e3
    time_s = changes.get("time_s")
    if None not in (view.time_s, time_s) and time_s <= view.time_s - 0.25:
        changes = {"timing": None, **changes, "restarts": view.restarts + 1}
    return view_with(view, changes)


@pytest.mark.parametrize("seed", range(8))
def test_built_view_equals_the_view_after_each_message(seed: int) -> None:
    random, link = Random(seed), Link(255, 190)
    builder, expected, lost, reads = ViewBuilder(VehicleView()), VehicleView(), 0, 0
    for frame, now_s in _frames(random):
        expected = _folded_at_once(expected, _decoded_at_once(frame), now_s)
        (message,) = link.decode(frame)
        builder.add(message, now_s)
        eager = expected.identity, expected.time_s, expected.last_heartbeat_s
        assert (builder.identity, builder.time_s, builder.last_heartbeat_s) == eager
        if random.random() < 0.1:
            built = builder.view._replace(link=expected.link)
            assert repr(built) == repr(expected)  # NaN differs from itself
            reads, lost = reads + 1, builder.link.lost
    assert reads > 20
    assert expected.ever_armed
    assert min(expected.restarts, lost, len(expected.texts)) > 0


def test_view_that_has_not_changed_is_the_same_object() -> None:
    builder = ViewBuilder(VehicleView())
    before = builder.view
    (message,) = Link(255, 190).decode(
        Link(1, 1).encode(mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))
    )
    assert not builder.add(message, 0.0)  # no heartbeat yet
    assert builder.view is before


@pytest.mark.parametrize("view", [VehicleView(), VehicleView(position_ned_m=Vector(1.0, 2.0, 3.0))])
def test_measurement_sets_the_same_values_whatever_it_holds(view: VehicleView) -> None:
    assert not FOLDS.keys() & MEASUREMENTS.keys()
    random = Random(1)
    for name, fold in MEASUREMENTS.items():
        kind, changed = _BY_NAME[name], set()
        for payload in (b"\0", *(_payload(kind, 1, random) for _ in range(20))):
            (message,) = Link(255, 190).decode(pack_frame(kind.id, payload, kind.crc_extra, 0, 1, 1))
            changed.add(frozenset(fold(view, message)))
        assert len(changed) == 1, name
