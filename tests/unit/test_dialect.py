"""The dialect: the generated layouts against the XML, checksums against pymavlink's generator."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.generator import mavparse

from flightstack.mavlink.dialect import LAYOUT_BY_NAME, EscStatus, FsLoopTiming, mavlink
from flightstack.mavlink.layout import Layout
from flightstack.mavlink.link import Link

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def parsed() -> dict[str, object]:
    xml = mavparse.MAVXML(str(ROOT / "flightstack/mavlink/flightstack.xml"), mavparse.PROTOCOL_2_0)
    return {message.name: message for message in xml.message}


@pytest.mark.parametrize("name", LAYOUT_BY_NAME)
def test_layouts_are_the_xmls(name: str, parsed) -> None:
    layout, message = LAYOUT_BY_NAME[name], parsed[name]
    assert (layout.message_id, layout.crc_extra) == (message.id, message.crc_extra)
    assert [field.name for field in layout.fields] == message.ordered_fieldnames
    assert struct.calcsize(layout.format) == message.wire_length <= 255


def test_the_generated_file_is_fresh() -> None:
    done = subprocess.run([sys.executable, "tools/generate_dialect.py", "--check"], cwd=ROOT, check=False)
    assert done.returncode == 0


def test_own_messages_lie_in_their_private_range_and_hide_none_of_common() -> None:
    own = {layout.message_id for layout in LAYOUT_BY_NAME.values()}
    assert {number for number in own if number != 291} == {53000, 53001, 53002}
    fresh = subprocess.run(
        [sys.executable, "-c", "from pymavlink.dialects.v20 import common as c; print(*c.mavlink_map)"],
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    assert not own & {int(number) for number in fresh}


def test_esc_status_is_mavlinks_standard_message() -> None:
    """Id 291 and checksum 10 are those of common.xml (message ESC_STATUS)."""
    assert (EscStatus.id, EscStatus.crc_extra) == (291, 10)


@pytest.mark.parametrize("layout", LAYOUT_BY_NAME.values(), ids=lambda layout: layout.name)
def test_messages_survive_the_codec(layout: Layout) -> None:
    kind = mavlink.mavlink_map[layout.message_id]
    values = {
        field.name: [index + 1 for index in range(field.length)] if field.is_array else 7
        for field in layout.fields
    }
    (message,) = Link(2, 1).decode(Link(3, 1).encode(kind(**values)))
    assert message.get_type() == layout.name
    assert message.get_srcSystem() == 3
    shown = message.to_dict()
    for name, value in values.items():
        assert list(shown[name]) == value if isinstance(value, list) else shown[name] == value


def test_trailing_zeros_are_cut_and_restored() -> None:
    frame = Link(1, 1).encode(FsLoopTiming(5, *[0] * 13))
    assert len(frame) == 12 + 1
    (message,) = Link(1, 1).decode(frame)
    assert (message.time_us, message.clock, message.lateness_max_us) == (5, 0, 0.0)


def test_a_link_counts_and_never_raises() -> None:
    sender, receiver = Link(1, 1), Link(2, 1)
    good = sender.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
    bad = bytearray(good)
    bad[12] ^= 1
    assert [message.get_type() for message in receiver.decode(bytes(bad) + good)] == ["HEARTBEAT"]
    assert (receiver.received, receiver.bad, sender.sent) == (1, 1, 1)
    assert not receiver.has_partial
    assert list(receiver.decode(good[:5])) == []
    assert receiver.has_partial
    assert len(list(receiver.decode(good[5:]))) == 1
