"""``Snapshot``: the state of a vehicle is complete without waiting for its slowest streams."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from flightstack.mavlink.link import Address, Link, Message
from gcs_cli.link.subscription import Snapshot
from gcs_cli.vehicle.view_types import (
    Estimator,
    Euler,
    GeoPosition,
    Gnss,
    Identity,
    LoopTiming,
    Mission,
    VehicleView,
)
from tests.support.folded_vehicle import Vehicle, heartbeat
from tests.support.telemetry_status import usual_timing

OURS = VehicleView(identity=Identity(7, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4))
TIMING = LoopTiming(0.0, 0, None, None, *[None] * 9, lockstep=True)
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
OWN, VEHICLE = Address(255, 190), Address(7, 1)


def refusal(target: Address = OWN, sender: Address = VEHICLE) -> Message:
    ack = mavlink.MAVLink_command_ack_message(REQUEST, mavlink.MAV_RESULT_DENIED, 0, 0, *target)
    (received,) = Link(*target).decode(Link(*sender).encode(ack))
    return received


def snapshot_of(view: VehicleView) -> Snapshot:
    return Snapshot(lambda: view, OWN)


def requested(snapshot: Snapshot) -> list[int]:
    messages = snapshot.poll(0.0)
    assert {(m.target_system, m.target_component, m.command) for m in messages} <= {(7, 1, REQUEST)}
    return [int(message.param1) for message in messages]


def test_snapshot_requests_nothing_before_a_heartbeat() -> None:
    assert requested(snapshot_of(VehicleView())) == []


def test_snapshot_requests_all_missing_messages_once() -> None:
    view = OURS._replace(
        attitude=Euler(0.0, 0.0, 0.0),
        position_ned_m=(0.0, 0.0, 0.0),
        landed_state=1,
        mission=Mission(0, reached=0),
    )
    snapshot = snapshot_of(view)
    battery, geo = mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    health = [mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS]
    assert sorted(requested(snapshot)) == sorted([battery, geo, EscStatus.id, FS_LOOP_TIMING_ID, *health])
    assert requested(snapshot) == []


@pytest.mark.parametrize(("refusals", "complete"), [(9, False), (10, True)])
def test_snapshot_does_not_wait_for_refused_messages(refusals: int, complete: bool) -> None:
    snapshot = snapshot_of(OURS._replace(healthy=True))
    assert len(requested(snapshot)) == 10
    for _ in range(refusals):
        snapshot.receive(refusal(), 0.0)
    assert snapshot.complete is complete


def test_refusal_of_the_reached_item_stands_for_no_other_message() -> None:
    """The vehicle denies it before the first reached item, and its acknowledgement names no message."""
    view = OURS._replace(
        attitude=Euler(0.0, 0.0, 0.0), position_ned_m=(0.0, 0.0, 0.0), landed_state=1, healthy=True,
        geo=GeoPosition(0.0, 0.0, 0.0, 0.0), rotor_rpm=(1.0,), timing=TIMING,
        gnss=Gnss(3), estimator=Estimator(True, True, True, True),
    )  # fmt: skip
    snapshot = snapshot_of(view)
    current, reached = mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
    assert requested(snapshot) == [current, reached]
    snapshot.receive(refusal(), 0.0)
    assert not snapshot.complete


@pytest.mark.parametrize(
    "foreign",
    [refusal(target=Address(254, 190)), refusal(sender=Address(7, 100))],
    ids=["to another client", "from a camera"],
)
def test_refusals_of_other_requests_do_not_complete_the_snapshot(foreign: Message) -> None:
    snapshot = snapshot_of(OURS)
    for _ in requested(snapshot):
        snapshot.receive(foreign, 0.0)
    assert not snapshot.complete


def test_snapshot_requests_no_messages_that_the_autopilot_lacks() -> None:
    identity = Identity(7, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    snapshot = snapshot_of(VehicleView(identity=identity))
    reached = mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED  # the answer may be of a former mission
    assert not {EscStatus.id, FS_LOOP_TIMING_ID, reached} & set(requested(snapshot))


def test_figures_of_loops_end_with_a_restart() -> None:
    """They stayed until the vehicle sent new ones."""
    vehicle = Vehicle()
    vehicle.send(heartbeat())
    vehicle.send(mavlink.MAVLink_attitude_message(60_000, 0, 0, 0, 0, 0, 0))
    assert vehicle.send(usual_timing()).timing is not None
    vehicle.send(mavlink.MAVLink_attitude_message(60_100, 0, 0, 0, 0, 0, 0))
    assert vehicle.view.timing is not None
    view = vehicle.send(mavlink.MAVLink_attitude_message(500, 0, 0, 0, 0, 0, 0))
    assert (view.timing, view.restarts) == (None, 1)
    assert vehicle.send(usual_timing()).timing is not None
