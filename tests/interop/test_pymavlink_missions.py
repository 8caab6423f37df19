"""Scripts on pymavlink load missions with ``MAVWPLoader``: with float items, as most do, and with integer ones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavwp

from tests.interop.stack import HOST, RealVehicle
from tests.interop.witness import Witness, mavutil

mavlink = mavutil.mavlink
MISSION = Path(__file__).parents[2] / "missions" / "triangle.waypoints"
REQUESTS = ["MISSION_REQUEST", "MISSION_REQUEST_INT"]


@pytest.fixture
def script(station_vehicle: RealVehicle) -> Iterator[Witness]:
    script = Witness(f"tcp:{HOST}:{station_vehicle.tcp_port}", 1 + station_vehicle.instance)
    yield script
    script.close()


def load(script: Witness) -> mavwp.MAVWPLoader:
    """Read the mission as ``MAVWPLoader`` does: latitude and longitude as floats of 32 bits on the wire."""
    loader = mavwp.MAVWPLoader(script.system, 1)
    assert loader.load(str(MISSION)) == 5
    return loader


def as_integers(item: Any) -> Any:
    """Return a float item as MISSION_ITEM_INT."""
    return mavlink.MAVLink_mission_item_int_message(
        item.target_system, item.target_component, item.seq, item.frame, item.command, item.current,
        item.autocontinue, item.param1, item.param2, item.param3, item.param4,
        round(item.x * 1e7), round(item.y * 1e7), item.z,
    )  # fmt: skip


def upload(script: Witness, items: list[Any]) -> list[str]:
    """Send items as they are asked for; return the kinds of the requests."""
    script.connection.waypoint_clear_all_send()
    assert script.until("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    script.connection.waypoint_count_send(len(items))
    kinds = []
    while (message := script.until([*REQUESTS, "MISSION_ACK"])).get_type() != "MISSION_ACK":
        kinds.append(message.get_type())
        script.mav.send(items[message.seq])
    assert message.type == mavlink.MAV_MISSION_ACCEPTED
    return kinds


def download(script: Witness, integers: bool) -> list[Any]:
    """Ask for the items one after the other."""
    script.connection.waypoint_request_list_send()
    items = []
    for seq in range(script.until("MISSION_COUNT").count):
        if integers:
            script.mav.mission_request_int_send(script.system, 1, seq)
        else:
            script.connection.waypoint_request_send(seq)
        items.append(script.until("MISSION_ITEM_INT" if integers else "MISSION_ITEM"))
    script.mav.mission_ack_send(script.system, 1, mavlink.MAV_MISSION_ACCEPTED)
    return items


def test_float_items_go_up_come_back_and_are_flown(script: Witness) -> None:
    sent = load(script).wpoints
    kinds = upload(script, sent)
    assert kinds[0] == "MISSION_REQUEST_INT"
    assert set(kinds[1:]) == {"MISSION_REQUEST"}  # the script turned out to speak floats
    for item, back in zip(sent, download(script, integers=False), strict=True):
        assert (back.seq, back.frame, back.command) == (item.seq, item.frame, item.command)
        assert back.z == item.z
        # a float of 32 bits counts 47° in steps of 3.8e-6° (0.4 m)
        assert (back.x, back.y) == pytest.approx((item.x, item.y), abs=4e-6)
    script.connection.arducopter_arm()
    script.connection.motors_armed_wait()
    script.connection.set_mode_auto()
    assert script.until("COMMAND_ACK", lambda ack: ack.command == 300).result == mavlink.MAV_RESULT_ACCEPTED
    for seq in (2, 3):
        script.until("MISSION_ITEM_REACHED", lambda reached, seq=seq: reached.seq == seq)
    script.until("MISSION_CURRENT", lambda now: now.mission_state == mavlink.MISSION_STATE_COMPLETE)
    script.connection.motors_disarmed_wait()


def test_integer_items_come_back_to_the_last_digit(script: Witness) -> None:
    sent = [as_integers(item) for item in load(script).wpoints]
    assert set(upload(script, sent)) == {"MISSION_REQUEST_INT"}
    for item, back in zip(sent, download(script, integers=True), strict=True):
        assert (back.seq, back.frame, back.command) == (item.seq, item.frame, item.command)
        assert (back.x, back.y, back.z) == (item.x, item.y, item.z)
    script.connection.waypoint_set_current_send(3)
    assert script.until("MISSION_CURRENT", lambda now: now.seq == 3).total == len(sent)
    script.connection.waypoint_clear_all_send()
    assert script.until("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    assert download(script, integers=True) == []


def test_a_mission_that_cannot_be_flown_leaves_the_old_one(script: Witness) -> None:
    loader = load(script)
    upload(script, loader.wpoints)
    bad = mavlink.MAVLink_mission_item_message(script.system, 1, 0, 3, 16, 1, 1, 0, 0, 0, 0, 95.0, 8.5, 4.0)
    script.connection.waypoint_count_send(1)
    script.until(REQUESTS)
    script.mav.send(bad)
    assert script.until("MISSION_ACK").type != mavlink.MAV_MISSION_ACCEPTED
    assert len(download(script, integers=False)) == loader.count()
