"""``Snapshot``: the state of a vehicle is complete without waiting for its slowest streams."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, EscStatus, mavlink
from gcs_cli.link.snapshot import Snapshot
from gcs_cli.vehicle.view_types import Euler, Identity, Mission, VehicleView

OURS = VehicleView(identity=Identity(7, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4))
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
REFUSED = mavlink.MAVLink_command_ack_message(REQUEST, mavlink.MAV_RESULT_UNSUPPORTED)


def requested(snapshot: Snapshot) -> list[int]:
    messages = snapshot.poll(0.0)
    assert {(m.target_system, m.target_component, m.command) for m in messages} <= {(7, 1, REQUEST)}
    return [int(message.param1) for message in messages]


def test_snapshot_requests_nothing_before_a_heartbeat() -> None:
    assert requested(Snapshot(VehicleView)) == []


def test_snapshot_requests_all_missing_messages_once() -> None:
    view = OURS._replace(
        attitude=Euler(0.0, 0.0, 0.0), position_ned_m=(0.0, 0.0, 0.0), landed_state=1, mission=Mission(0)
    )
    snapshot = Snapshot(lambda: view)
    battery, geo = mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    assert sorted(requested(snapshot)) == sorted([battery, geo, EscStatus.id, FS_LOOP_TIMING_ID])
    assert requested(snapshot) == []


@pytest.mark.parametrize(("refusals", "complete"), [(6, False), (7, True)])
def test_snapshot_does_not_wait_for_refused_messages(refusals: int, complete: bool) -> None:
    snapshot = Snapshot(lambda: OURS._replace(healthy=True))
    assert len(requested(snapshot)) == 7
    for _ in range(refusals):
        snapshot.receive(REFUSED, 0.0)
    assert snapshot.complete is complete


def test_snapshot_requests_no_messages_that_the_autopilot_lacks() -> None:
    identity = Identity(7, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    snapshot = Snapshot(lambda: VehicleView(identity=identity))
    assert not {EscStatus.id, FS_LOOP_TIMING_ID} & set(requested(snapshot))
