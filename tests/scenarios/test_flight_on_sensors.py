"""Missions of a vehicle that estimates its state from its sensors."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightstack.core.contract import Quaternion
from flightstack.core.errors import ConfigError
from flightstack.estimation.error_state import WIND, turn_between
from flightstack.mavlink.dialect import mavlink
from flightstack.params import vehicle
from flightstack.testing import World
from tests.support.estimate_errors import Watch
from tests.support.refusals import refused


def test_square_on_sensors_is_completed_within_the_limits_of_gnss() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        watch = Watch(world)
        flight = world.fly("square")
    assert flight.completed, flight.outcome
    errors = watch.errors()  # measured: 0.21°, 0.55°, 0.05 m/s, 0.24 m, 0.17 m, 0.38 m
    assert errors.tilt_deg < 0.5
    assert errors.yaw_deg < 2.0
    assert errors.velocity_m_s < 0.15
    assert errors.horizontal_m < 0.7
    assert errors.vertical_m < 0.4
    assert errors.landing_m < 1.5


def test_ideal_sensors_at_rest_and_in_hover_are_not_stuck(tmp_path: Path) -> None:
    text = (Path(vehicle.__file__).parent / "vehicles" / "x_quad.toml").read_text()
    path = tmp_path / "ideal_quad.toml"
    path.write_text(text.replace('grade = "consumer"', 'grade = "ideal"'))
    with World(vehicle=str(path), state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(5.0)
        world.run_for(40.0)
        world.land()
        world.run_until("not armed")
        assert world.texts == ["Armed", "Takeoff detected", "Landing detected", "Disarmed"]


def test_rotors_are_quiet_in_hover_on_sensors() -> None:
    with World(vehicle="x_quad", state="estimated", seed=3) as world:
        world.wait_until_ready()
        world.takeoff(3.0)
        world.run_for(8.0)
        commands = []
        for _ in range(1000):
            world.tick()
            commands.append(world.engine.actuators.rotor_speed_rad_s[:4].copy())
    changes = np.diff(np.array(commands), axis=0)
    rms_rad_s = float(np.sqrt(np.mean(np.square(changes))))
    assert rms_rad_s < 2.0  # measured 1.7; 11 without EKF2_TAU_VEL and IMU_GYRO_CUTOFF


DRAG = {"EKF2_DRAG_CTRL": 1, "EKF2_DRAG_NOISE": 0.1, "EKF2_MCOEF": 0.2, "EKF2_BCOEF_X": 0, "EKF2_BCOEF_Y": 0}
"""The drag of x_quad: 0.3 N s/m and 1.5 kg."""


def test_wind_is_estimated_from_drag() -> None:
    winds = {}
    for params in (DRAG, {}):
        with World(vehicle="x_quad", state="estimated", wind=(4.0, -2.0), params=params) as world:
            world.wait_until_ready()
            world.arm()
            world.takeoff()
            world.run_for(20.0)
            estimator = world.engine.stack.estimation.estimator
            winds[bool(params)] = estimator.memory["nominal"][0, 22:24], estimator.deviations()[WIND]
    wind, deviation = winds[True]
    assert np.abs(wind - [4.0, -2.0]).max() < 1.0
    assert deviation < 0.7
    wind, deviation = winds[False]
    assert (wind == 0.0).all()
    assert deviation >= 5.0  # and so not told as known


def test_magnetometer_turned_at_boot_is_replaced_by_gnss_velocity() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.fault("sensor:mag:turn=90")
        world.wait_until_ready()
        world.arm()
        world.takeoff(8.0)
        world.run_for(16.0)  # 9 to 13 s with four seeds
        estimator, truth = world.engine.stack.estimation.estimator, world.engine.simulator.frame.state
        assert estimator.memory["flags"][0]["mag_fault"] == 1
        assert sum("Compass disagrees with GNSS" in text for text in world.texts) == 1
        error = turn_between(Quaternion(*truth[6:10].tolist()), estimator.state().attitude)
        assert abs(math.degrees(error)) < 8.0  # measured 2; 50 if the filter follows alone
        world.fault("sensor:mag:off", for_s=2.0)
        world.run_for(4.0)
        assert "Compass is missing and not used" in world.texts
        assert "Compass is used again" not in world.texts
        assert sum("Compass disagrees with GNSS" in text for text in world.texts) == 1


def test_flights_on_sensors_of_one_seed_are_equal_to_the_byte() -> None:
    logs = []
    for seed in (4, 4, 5):
        with World(vehicle="x_quad", state="estimated", seed=seed) as world:
            logs.append(world.fly("hop").log.content)
    assert logs[0] == logs[1] != logs[2]


def test_vehicle_on_sensors_refuses_to_arm_before_its_position_is_known() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        assert not world.engine.stack.now.has_state
        world.wait_until_ready()
        assert 0.4 < world.time_s < 5.0
        world.arm()


def test_barometer_that_freezes_on_the_ground_refuses_arming() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.run_for(3.0)
        world.fault("sensor:baro:freeze")
        world.run_for(1.5)
        with refused(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "the barometer is stuck"):
            world.arm()


def test_barometer_that_freezes_in_the_air_is_reported_and_so_is_its_return() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(4.0)
        world.run_for(6.0)
        world.fault("sensor:baro:freeze", for_s=3.0)
        world.run_for(2.0)
        assert "Barometer is stuck or missing and not used" in world.texts
        world.run_for(3.0)
        assert "Barometer is used again" in world.texts


def test_magnetometer_that_goes_silent_in_the_air_is_reported_and_so_is_its_return() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(4.0)
        world.run_for(6.0)
        world.fault("sensor:mag:off", for_s=3.0)
        world.run_for(2.0)
        assert world.texts.count("Compass is missing and not used") == 1
        world.run_for(3.0)
        assert world.texts[-1] == "Compass is used again"


@pytest.mark.parametrize(
    ("conditions", "text"),
    [({"state": "guessed"}, "is not one of estimated, truth")],
)
def test_source_of_the_state_is_checked(conditions: dict, text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        World(**conditions)


KNOWN_ROW = 30
"""Row of the log, of 100 Hz, after the first fix at the horizon: until it is valid, the validity has 10 Hz."""


@pytest.mark.parametrize("bias", ["15,-10,0", "15,-10,10"])
def test_vehicle_does_not_tilt_for_a_reset_of_its_position(bias: str) -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(5.0)
        world.run_until("mode == 'HOLD'")
        world.fault(f"sensor:gnss:bias={bias}")
        world.run_until(lambda _: any("Estimate reset by" in text for text in world.texts), 30.0)
        tilts = []
        for _ in range(20):
            tilts.append(max(abs(world.state.roll_deg), abs(world.state.pitch_deg)))
            world.step()
        assert max(tilts) < 15.0  # 12.0, on the way back to the goal; 45 without the shift
        error_m = world.engine.stack.now.setpoint[:2] - world.engine.stack.now.state[:2]
        assert max(abs(error_m)) < 0.5
        log = ULog(io.BytesIO(world.engine.newest_log()))
    position = log.get_dataset("vehicle_local_position").data
    assert (position["xy_valid"][KNOWN_ROW:] == 1).all()
    before = np.diff(position["xy_reset_counter"].astype(int)).nonzero()[0][0]
    after = before + 1
    assert position["delta_xy[0]"][after] == pytest.approx(
        position["x"][after] - position["x"][before], abs=0.2
    )


def test_log_has_an_invalid_position_after_dead_reckoning() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(15.0)
        world.run_until("mode == 'HOLD'")
        world.fault("sensor:gnss:off")
        world.run_for(15.0)
        log = ULog(io.BytesIO(world.engine.newest_log()))
    position = log.get_dataset("vehicle_local_position").data
    for name in ("xy_valid", "v_xy_valid", "xy_global"):
        assert (position[name][KNOWN_ROW], position[name][-1]) == (1, 0)
    assert (position["z_valid"] == 1).all()
    assert (position["dead_reckoning"][KNOWN_ROW], position["dead_reckoning"][-1]) == (0, 1)
    assert position["eph"][-1] > 2.0 * position["eph"][KNOWN_ROW]  # measured 2.3, and 1.2 after 8 s


def test_gnss_that_comes_back_is_not_suspected_of_spoofing() -> None:
    params = {"FS_GNSS_ACT": 2, "EKF2_BARO_DELAY": 200}
    with World(vehicle="x_quad", state="estimated", params=params) as world:
        world.wait_until_ready()
        world.takeoff(5.0)
        world.run_until("mode == 'HOLD'")
        world.fault("sensor:gnss:off", for_s=3.0)
        world.run_for(5.0)
        assert world.state.mode == "HOLD"
        assert not [text for text in world.texts if "Spoofed" in text]


@pytest.mark.parametrize(
    ("begin_s", "fault", "tilt_deg", "yaw_deg"),
    [
        (0.0, "sensor:gyro:bias=1,1,1", 0.5, 1.5),  # 0.22, 0.56
        (0.0, "sensor:imu:vibration=10", 0.5, 1.5),  # 0.22, 0.58
        (10.0, "sensor:mag:turn=90", 0.5, 3.0),  # 0.20, 1.41
        (10.0, "sensor:accel:bias=0.5,0,0", 1.9, 2.5),  # 1.48, 1.52
        (10.0, "sensor:gyro:bias=1,0,1", 1.3, 3.0),  # 0.87, 2.43
        (10.0, "sensor:mag:bias=0.03,-0.03,0", 0.5, 1.5),  # 0.25, 0.89
    ],
)
def test_estimate_stays_true_with_a_faulty_sensor(
    begin_s: float, fault: str, tilt_deg: float, yaw_deg: float
) -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        watch = Watch(world)
        world.after(begin_s, lambda: world.fault(fault))
        assert world.fly("square").completed
    errors = watch.errors()
    assert errors.tilt_deg < tilt_deg
    assert errors.yaw_deg < yaw_deg
    assert errors.horizontal_m < 0.7  # 0.28 at most


def test_square_on_sensors_is_flown_by_the_loops_in_c() -> None:
    with World(vehicle="x_quad", state="estimated", loops="c") as world:
        assert world.fly("square").completed


def test_a_hit_beyond_the_range_of_the_accelerometer_is_no_failsafe() -> None:
    with World(vehicle="x_quad", state="estimated") as world:
        world.wait_until_ready()
        world.takeoff(5.0)
        world.run_for(8.0)
        world.fault("sensor:accel:bias=0,0,-200", for_s=0.004)
        world.run_for(5.0)
        assert world.texts == ["Armed", "Takeoff detected"]
        assert abs(world.state.altitude_m - 5.0) < 0.5  # measured 0.1
