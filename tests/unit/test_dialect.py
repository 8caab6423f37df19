"""The dialect: the generated layouts against the XML, checksums against pymavlink's generator."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.generator import mavparse

from flightstack.mavlink.dialect import LAYOUT_BY_NAME, FsLoopTiming, mavlink
from flightstack.mavlink.layout import Field, Layout
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
    done = subprocess.run([sys.executable, "-m", "tools.generate_dialect", "--check"], cwd=ROOT, check=False)
    assert done.returncode == 0


OFFICIAL = {
    "ESC_STATUS": (291, 10),
    "MISSION_CURRENT": (42, 28),
    "MISSION_COUNT": (44, 221),
    "MISSION_ACK": (47, 153),
    "PROTOCOL_VERSION": (300, 217),
    "COMPONENT_METADATA": (397, 182),
    "AVAILABLE_MODES": (435, 134),
    "CURRENT_MODE": (436, 193),
    "AVAILABLE_MODES_MONITOR": (437, 30),
}
"""Ids and checksums as MAVLink's own headers have them (c_library_v2, common)."""

EXTENDED = {42, 44, 47}
"""Messages of pymavlink's common dialect that ours replace by longer ones."""

PYMAVLINKS = """
from pymavlink.dialects.v20 import common as c
codec = c.MAVLink(None, 1, 1)
print(*c.mavlink_map)
print(c.MAVLink_mission_current_message(3, 9, 2, 1).pack(codec).hex())
print(c.MAVLink_mission_count_message(1, 1, 300, 2).pack(codec).hex())
print(c.MAVLink_mission_ack_message(255, 190, 5, 1).pack(codec).hex())
"""


@pytest.fixture(scope="module")
def unchanged() -> list[str]:
    """What pymavlink's dialect says in a process that never saw ours."""
    done = subprocess.run([sys.executable, "-c", PYMAVLINKS], capture_output=True, text=True, check=True)
    return done.stdout.split("\n")


def test_own_messages_lie_in_their_private_range_and_hide_none_of_common(unchanged) -> None:
    own = {layout.message_id for name, layout in LAYOUT_BY_NAME.items() if name not in OFFICIAL}
    assert own == {53000, 53001, 53002, *range(53010, 53022)}
    ours = {layout.message_id for layout in LAYOUT_BY_NAME.values()}
    assert ours & {int(number) for number in unchanged[0].split()} == EXTENDED


@pytest.mark.parametrize("name", OFFICIAL)
def test_standard_messages_have_mavlinks_ids_and_checksums(name: str) -> None:
    layout = LAYOUT_BY_NAME[name]
    kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
    assert (layout.message_id, layout.crc_extra) == (kind.id, kind.crc_extra) == OFFICIAL[name]
    assert getattr(mavlink, f"MAVLINK_MSG_ID_{name}") == kind.id
    assert mavlink.mavlink_map[kind.id] is kind


def test_extended_messages_are_pymavlinks_byte_for_byte_without_their_new_fields(unchanged) -> None:
    codec = mavlink.MAVLink(None, 1, 1)
    assert mavlink.MAVLink_mission_current_message(3, 9, 2, 1).pack(codec).hex() == unchanged[1]
    assert mavlink.MAVLink_mission_count_message(1, 1, 300, 2).pack(codec).hex() == unchanged[2]
    assert mavlink.MAVLink_mission_ack_message(255, 190, 5, mission_type=1).pack(codec).hex() == unchanged[3]
    assert codec.mission_count_encode(1, 1, 300, 2).opaque_id == 0


def test_extension_fields_may_be_left_out_and_others_not() -> None:
    assert mavlink.MAVLink_mission_current_message(7).rally_points_id == 0
    for values, named in (
        ((), {}),
        ((1, 1), {"opaque_id": 3}),
        ((1, 1, 2, 0, 5, 6), {}),
        ((1, 1, 2), {"x": 1}),
    ):
        with pytest.raises(TypeError, match="MISSION_COUNT takes the fields target_system"):
            mavlink.MAVLink_mission_count_message(*values, **named)


def test_text_fields_are_given_as_bytes_and_read_as_strings() -> None:
    sent = mavlink.MAVLink_available_modes_message(9, 2, 0, 1 << 16, 3, b"Position hold\0junk")
    assert sent.mode_name == "Position hold"
    (message,) = Link(2, 1).decode(Link(3, 1).encode(sent))
    assert (message.number_modes, message.custom_mode, message.mode_name) == (9, 1 << 16, "Position hold")
    uri = b"mftp:///etc/extras/component_general.json.xz"
    metadata = mavlink.MAVLink_component_metadata_message(time_boot_ms=5, file_crc=2**32 - 1, uri=uri)
    frame = Link(3, 1).encode(metadata)
    assert len(frame) == 12 + 8 + len(uri)
    (message,) = Link(2, 1).decode(frame)
    assert (message.file_crc, message.uri) == (2**32 - 1, uri.decode())


@pytest.mark.parametrize("layout", LAYOUT_BY_NAME.values(), ids=lambda layout: layout.name)
def test_messages_survive_the_codec(layout: Layout) -> None:
    kind = mavlink.mavlink_map[layout.message_id]
    values = {field.name: _value(field) for field in layout.fields}
    (message,) = Link(2, 1).decode(Link(3, 1).encode(kind(**values)))
    assert message.get_type() == layout.name
    assert message.get_srcSystem() == 3
    shown = message.to_dict()
    for name, value in values.items():
        assert shown[name] == (value.decode() if isinstance(value, bytes) else value)


def _value(field: Field) -> object:
    if field.is_text:
        return b"x" * field.length
    return [index + 1 for index in range(field.length)] if field.is_array else 7


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
