"""BATTERY_STATUS of the simulator link: the same bytes as pymavlink's, and no bytes that it cannot take."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.battery_frame import BatteryReport, decode_battery, encode_battery, report_of

WORD = st.integers(0, 0xFFFF)
REPORTS = st.builds(
    BatteryReport,
    number=st.integers(0, 255),
    cells_mv=st.tuples(*[WORD] * 14),
    current_ca=st.integers(-1, 0x7FFF),
    consumed_mah=st.integers(-1, 2**31 - 1),
    energy_hj=st.integers(-1, 2**31 - 1),
    remaining_percent=st.integers(-1, 100),
)
THREE_CELLS = BatteryReport(0, (3900,) * 3 + (0xFFFF,) * 7 + (0,) * 4, 1250, 100, 4, 64)


def by_pymavlink(report: BatteryReport, seq: int) -> bytes:
    codec = mavlink.MAVLink(None, 3, 200)
    codec.seq = seq
    message = mavlink.MAVLink_battery_status_message(
        report.number, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO, 0x7FFF,
        report.cells_mv[:10], report.current_ca, report.consumed_mah, report.energy_hj,
        report.remaining_percent, 0, 0, report.cells_mv[10:],
    )  # fmt: skip
    return bytes(message.pack(codec))


@given(REPORTS, st.integers(0, 255))
@example(THREE_CELLS, 0)
@example(THREE_CELLS._replace(remaining_percent=0), 255)
def test_the_bytes_are_those_of_pymavlink(report: BatteryReport, seq: int) -> None:
    frame = encode_battery(report, seq, 3, 200)
    assert frame == by_pymavlink(report, seq)
    assert decode_battery(frame) == report
    (message,) = Link(1, 1).decode(frame)
    assert report_of(message) == report


def test_a_changed_octet_makes_it_no_battery() -> None:
    """All but those of sequence, system and component are told by the header or the checksum; so are these."""
    frame = bytearray(encode_battery(THREE_CELLS, 0, 1, 200))
    assert len(frame) == 48
    for at in range(len(frame)):
        changed = frame.copy()
        changed[at] ^= 0x10
        assert decode_battery(changed) is None, at


@given(st.binary(max_size=80), st.integers(0, 60))
def test_any_bytes_are_a_battery_or_none(junk: bytes, cut: int) -> None:
    frame = encode_battery(THREE_CELLS, 0, 1, 200)
    assert decode_battery(junk) is None
    whole = len(frame)
    assert decode_battery(frame[:cut]) == (THREE_CELLS if cut >= whole else None)
    assert decode_battery(frame + junk) == (None if junk else THREE_CELLS)


def test_a_longer_message_of_a_later_dialect_is_taken_without_its_end() -> None:
    """MAVLink lets fields be added behind: a reader that does not know them leaves them out."""
    kind = mavlink.MAVLink_battery_status_message
    codec = mavlink.MAVLink(None, 1, 200)
    message = kind(0, 0, 1, 0, [3900] * 10, 5, 6, 7, 8, 0, 0, [0] * 4, 0, 9)
    message.pack(codec)
    longer = bytes(message._pack(codec, kind.crc_extra, message.get_payload().ljust(54, b"\0") + b"\1\2"))
    report = decode_battery(longer)
    assert report is not None
    assert report[:4] == (0, (3900,) * 10 + (0,) * 4, 5, 6)
