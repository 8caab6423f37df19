"""Health of the vehicle in the messages to ground stations, during faults."""

from __future__ import annotations

import pytest

from flightstack.commander.transitions import Event
from flightstack.core.contract import Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from tests.support.truth import World

SYS_STATUS, GPS_RAW_INT, ESTIMATOR_STATUS, FENCE_STATUS, BATTERY_STATUS = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
)
SENSORS = mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_AHRS
LASTING = {"FS_STALE_T": 0.1, "FS_BLIND_T": 5}


def asked(world: World, message_id: int) -> Message:
    """Return the present message."""
    world.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)
    return world.gcs.received[mavlink.mavlink_map[message_id].msgname]


def flying(**params: float) -> World:
    world = World(vehicle="x_quad", params=params)
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'", 20.0)
    return world


def seems_healthy(world: World) -> bool:
    """Return True if the vehicle reports good health; all three messages must agree."""
    healthy = asked(world, SYS_STATUS).onboard_control_sensors_health & SENSORS == SENSORS
    assert (asked(world, GPS_RAW_INT).fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX) is healthy
    assert bool(asked(world, ESTIMATOR_STATUS).flags) is healthy
    return healthy


@pytest.mark.parametrize("fault", ["state:freeze", "state:nan"])
def test_invalid_state_is_unhealthy_while_the_fault_lasts(fault: str) -> None:
    world = flying(**LASTING)
    assert seems_healthy(world)
    world.fault(fault, for_s=0.4)
    world.run_for(0.3)
    assert not seems_healthy(world)
    world.run_for(0.3)
    assert seems_healthy(world)


def test_missing_state_is_unhealthy_on_the_ground() -> None:
    world = World(vehicle="x_quad", params=LASTING)
    world.run_for(0.1)
    assert seems_healthy(world)
    world.engine.loses_states = True
    world.run_for(0.3)
    assert not seems_healthy(world)


@pytest.mark.parametrize("fault", ["off", "freeze"])
def test_dead_imu_is_unhealthy_in_sys_status(fault: str) -> None:
    imu = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    bits = imu | mavlink.MAV_SYS_STATUS_AHRS
    with World(vehicle="x_quad", state="estimated") as world:
        world.run_for(6.0)
        assert asked(world, SYS_STATUS).onboard_control_sensors_health & bits == bits
        world.fault(f"sensor:imu:{fault}")
        world.run_for(1.0)
        assert not asked(world, SYS_STATUS).onboard_control_sensors_health & bits
        assert not asked(world, ESTIMATOR_STATUS).flags & mavlink.ESTIMATOR_ATTITUDE


def test_fence_status_has_kind_and_time_of_each_breach() -> None:
    world = flying(GF_ACTION=1, GF_PREDICT=0, GF_MAX_VER_DIST=3.5)
    before = asked(world, FENCE_STATUS)
    assert (before.breach_status, before.breach_count, before.breach_type) == (0, 0, 0)
    assert world.engine.stack.params.set("GF_MAX_VER_DIST", 2.0) is None
    began_ms = world.time_s * 1e3
    world.run_for(0.1)
    high = asked(world, FENCE_STATUS)
    assert (high.breach_status, high.breach_count, high.breach_type) == (1, 1, mavlink.FENCE_BREACH_MAXALT)
    assert began_ms <= high.breach_time <= began_ms + 20.0
    assert world.engine.stack.params.set("GF_MAX_VER_DIST", 0.0) is None
    world.run_for(0.5)
    over = asked(world, FENCE_STATUS)
    assert (over.breach_status, over.breach_count, over.breach_time) == (0, 1, high.breach_time)
    assert world.engine.stack.params.set("GF_MAX_HOR_DIST", 1.0) is None
    velocity = mavlink.MAVLink_set_position_target_local_ned_message
    world.gcs.streams["setpoint"] = lambda: velocity(0, 1, 1, 1, 0xDC7, 0, 0, 0, 2.0, 0, 0, 0, 0, 0, 0, 0)
    world.run_for(0.2)
    world.set_mode("OFFBOARD")
    world.run_until(lambda _: asked(world, FENCE_STATUS).breach_status == 1, 5.0)
    assert world.state.north_m > 1.0
    far = asked(world, FENCE_STATUS)
    assert (far.breach_count, far.breach_type) == (2, mavlink.FENCE_BREACH_BOUNDARY)


def test_charge_state_follows_the_battery_failsafes() -> None:
    world = World(vehicle="x_quad")
    told = []
    for level in (0.5, 0.13, 0.06, 0.04):
        world.fault(f"battery:level={level}")
        world.run_for(0.3)
        told.append(asked(world, BATTERY_STATUS).charge_state)
    assert told == [1, 2, 3, 4]


def test_fence_status_counts_a_breach_before_arming() -> None:
    world = World(vehicle="x_quad", params={"GF_ACTION": 0, "GF_MAX_HOR_DIST": 50})
    world.run_for(0.1)
    far = world.engine.stack.places.frame.to_geo(Vector3(200.0, 0.0, 0.0))
    assert world.engine.stack.area.set_home(far) is None
    world.arm()  # its checks evaluate the fence too
    world.run_for(0.1)
    status = asked(world, FENCE_STATUS)
    assert (status.breach_status, status.breach_count) == (1, 1)
    assert status.breach_type == mavlink.FENCE_BREACH_BOUNDARY


def test_fence_status_counts_a_breach_beside_a_mode_request() -> None:
    world = flying(GF_ACTION=1, GF_PREDICT=0)
    world.engine.stack.params.set("GF_MAX_VER_DIST", 2.0)
    assert world.engine.stack.parts.requests.request(Event.SELECT_HOLD) is None
    world.run_for(0.1)
    status = asked(world, FENCE_STATUS)
    assert (status.breach_status, status.breach_count) == (1, 1)
    assert status.breach_type == mavlink.FENCE_BREACH_MAXALT
