"""What notices a fault: limits, times, hysteresis; and links on two clocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightstack.commander.failsafe import Failsafe
from flightstack.commander.fault_detector import (
    BATTERY_HYSTERESIS,
    BEYOND_ATTITUDE,
    BEYOND_POSITION,
    DETECTORS,
    MOVING,
    NOT_FINITE,
    ROTOR_FAULT,
    ROTOR_SPEEDS,
    FaultDetector,
    battery_level,
    detect,
    detector_limits,
    follow_rotors,
    rotor_lags,
)
from flightstack.core.contract import LoopRow, LoopStatus
from flightstack.params.behaviour import Behaviour, with_assignments
from flightstack.params.vehicle import load_vehicle
from flightstack.services.streams.link_loss import SilenceTimer

DT_S, INNER_S = 0.01, 0.002
VEHICLE = load_vehicle("x_quad")


class Bench:
    """One vehicle's detectors, at 100 Hz."""

    def __init__(self, *assignments: str) -> None:
        behaviour = with_assignments(Behaviour(), list(assignments))
        self.limits = detector_limits(behaviour, VEHICLE)
        self.lags = rotor_lags(VEHICLE, INNER_S)
        self.rotors = np.zeros(1, ROTOR_SPEEDS)
        self.memory = np.zeros(1, DETECTORS)
        self.state = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
        self.setpoint = np.zeros(11)
        self.on_ground = False
        self.row = np.zeros(LoopRow.SIZE)
        self.row[LoopRow.REFERENCE_ATTITUDE] = 1.0, 0.0, 0.0, 0.0
        self.row[LoopRow.ROTOR_COMMAND] = self.row[LoopRow.ROTOR_SPEED] = 300.0

    def attitude(self, roll_deg: float, pitch_deg: float = 0.0, yaw_deg: float = 0.0) -> None:
        x, y, z, w = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_quat()
        self.state[6:10] = w, x, y, z

    def run(self, seconds: float) -> int:
        found = 0
        for _ in range(round(seconds / DT_S)):
            for _ in range(5):
                follow_rotors(self.row, self.rotors, self.lags)
            found = detect(
                self.state,
                self.setpoint,
                self.row,
                self.rotors,
                self.memory,
                self.limits,
                self.on_ground,
                DT_S,
            )
        return found


def test_a_quiet_flight_triggers_nothing() -> None:
    assert Bench().run(60.0) == 0


@pytest.mark.parametrize(
    ("roll", "pitch", "beyond"),
    [(59, 0, False), (61, 0, True), (-61, 0, True), (0, 61, True), (0, -59, False), (180, 0, True)],
)
def test_roll_and_pitch_have_limits_and_times(roll: float, pitch: float, beyond: bool) -> None:
    bench = Bench("FS_ATT_ERR=0")
    bench.attitude(roll, pitch, yaw_deg=77.0)
    assert not bench.run(0.29) & BEYOND_ATTITUDE
    assert bool(bench.run(0.01) & BEYOND_ATTITUDE) is beyond


def test_limits_leave_room_for_the_largest_tilt() -> None:
    bench = Bench("FS_ATT_ERR=0", "MPC_TILTMAX_AIR=70")
    bench.attitude(80.0)
    assert not bench.run(2.0) & BEYOND_ATTITUDE
    bench.attitude(86.0)
    assert bench.run(0.3) & BEYOND_ATTITUDE


def test_a_limit_of_zero_is_off() -> None:
    bench = Bench("FD_FAIL_R=0", "FD_FAIL_P=0", "FS_ATT_ERR=0", "FS_POS_ERR=0", "FD_ACT_EN=0")
    bench.attitude(150.0, 80.0)
    bench.state[0] = 1e6
    bench.row[LoopRow.ROTOR_SPEED] = 10.0
    assert bench.run(10.0) == 0


@given(
    st.floats(-1.4, 1.4),
    st.floats(-1.4, 1.4),
    st.floats(-3.1, 3.1),
    st.floats(-1.4, 1.4),
    st.floats(-1.4, 1.4),
)
def test_tilt_error_is_the_angle_between_the_thrust_axes(
    roll: float, pitch: float, yaw: float, other_roll: float, other_pitch: float
) -> None:
    """Compared with SciPy's rotations; yaw does not count."""
    one = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    other = Rotation.from_euler("ZYX", [0.3, other_pitch, other_roll])
    axes = one.as_matrix()[:, 2], other.as_matrix()[:, 2]
    angle = math.acos(max(-1.0, min(1.0, float(np.dot(*axes)))))
    if abs(angle - math.radians(30.0)) < 1e-6:
        return
    bench = Bench("FD_FAIL_R=0", "FD_FAIL_P=0", "FS_ATT_ERR_T=0.02")
    x, y, z, w = one.as_quat()
    bench.state[6:10] = w, x, y, z
    x, y, z, w = other.as_quat()
    bench.row[LoopRow.REFERENCE_ATTITUDE] = w, x, y, z
    assert bool(bench.run(0.05) & BEYOND_ATTITUDE) is (angle > math.radians(30.0))


def test_on_the_ground_the_reference_may_differ_but_the_vehicle_must_stand_upright() -> None:
    bench = Bench()
    bench.row[LoopRow.REFERENCE_ATTITUDE] = math.cos(0.5), math.sin(0.5), 0.0, 0.0  # 57°
    bench.on_ground = True
    assert not bench.run(10.0) & BEYOND_ATTITUDE
    bench.on_ground = False
    assert bench.run(0.5) & BEYOND_ATTITUDE
    fallen = Bench()
    fallen.on_ground = True
    fallen.attitude(90.0)
    assert fallen.run(0.3) & BEYOND_ATTITUDE


def test_position_error_has_a_limit_a_time_and_a_release() -> None:
    bench = Bench()
    bench.state[:3] = 6.0, 8.1, 0.0
    assert not bench.run(0.99) & BEYOND_POSITION
    assert bench.run(0.01) & BEYOND_POSITION
    bench.state[:3] = 6.0, 7.9, 0.0
    assert bench.run(0.99) & BEYOND_POSITION
    assert not bench.run(0.02) & BEYOND_POSITION


def test_a_moment_beyond_the_limit_begins_the_time_anew() -> None:
    bench = Bench()
    for _ in range(5):
        bench.state[0] = 11.0
        assert not bench.run(0.9) & BEYOND_POSITION
        bench.state[0] = 9.0
        bench.run(0.01)


@pytest.mark.parametrize(
    ("speed", "fault"), [(300.0, False), (215.0, False), (205.0, True), (0.0, True), (395.0, True)]
)
def test_a_rotor_must_follow_its_command(speed: float, fault: bool) -> None:
    """A fault shows once the mean has followed (0.03 s) for the time that is allowed (0.1 s)."""
    bench = Bench()
    bench.run(1.0)
    bench.row[LoopRow.ROTOR_SPEED.start + 2] = speed
    assert not bench.run(0.1) & ROTOR_FAULT
    assert bool(bench.run(0.25) & ROTOR_FAULT) is fault


@pytest.mark.parametrize("period", [1, 2, 3, 5, 10, 25])
def test_rotors_that_are_shaken_are_no_fault(period: int) -> None:
    """Commands from limit to limit, also in step with the outer loop, followed with the rotors' lag."""
    bench = Bench("FS_ROT_ERR=0.1")
    lag_s = VEHICLE.rotors[0].lag_s
    command, speed = bench.row[LoopRow.ROTOR_COMMAND], bench.row[LoopRow.ROTOR_SPEED]
    command[:] = speed[:] = 0.0
    for tick in range(2000):
        command[:] = 900.0 if tick // period % 2 else 100.0
        follow_rotors(bench.row, bench.rotors, bench.lags)
        if tick % 5 == 0:
            found = detect(
                bench.state, bench.setpoint, bench.row, bench.rotors, bench.memory, bench.limits, False, DT_S
            )
            assert not found & ROTOR_FAULT
        speed += (command - speed) * (1.0 - math.exp(-INNER_S / lag_s))


def test_speed_that_stays_equal_is_thrust_without_a_command() -> None:
    """A rotor that is stuck turns so; the vehicle must not be found landed and disarmed in the air."""
    bench = Bench()
    bench.run(1.0)
    thrust_n = float(bench.rotors["thrust"][0])
    bench.row[LoopRow.ROTOR_COMMAND] = 0.0
    bench.row[LoopRow.ROTOR_SPEED] = 300.0
    bench.run(1.0)
    assert float(bench.rotors["thrust"][0]) == pytest.approx(thrust_n, rel=0.01)


def test_speeds_that_nobody_measures_are_no_fault() -> None:
    bench = Bench()
    bench.row[LoopRow.ROTOR_SPEED] = 0.0
    assert not bench.run(5.0) & ROTOR_FAULT


def test_rotors_that_all_stop_in_flight_are_a_fault_that_stays() -> None:
    """As with an empty battery: zeros are no missing measurement in a flight that has had others."""
    bench = Bench()
    assert not bench.run(1.0) & ROTOR_FAULT
    bench.row[LoopRow.ROTOR_SPEED] = 0.0
    assert not bench.run(0.1) & ROTOR_FAULT
    for _ in range(50):
        found = bench.run(0.1)
    assert found & ROTOR_FAULT


def test_a_number_that_is_none_is_found_at_once() -> None:
    for index in range(13):
        for value in (math.nan, math.inf, -math.inf):
            bench = Bench()
            bench.state[index] = value
            assert bench.run(DT_S) == NOT_FINITE, (index, value)


def test_an_output_that_is_none_is_found() -> None:
    bench = Bench()
    bench.row[LoopRow.STATUS] = LoopStatus.OUTPUT_NOT_FINITE
    assert bench.run(DT_S) & NOT_FINITE


BAD_NUMBERS = [math.nan, math.inf, -math.inf, 3e38]
"""What one sample may be: not a number, infinite, or the largest that the wire carries."""


@pytest.mark.parametrize("bad", BAD_NUMBERS)
@pytest.mark.parametrize("column", [LoopRow.ROTOR_SPEED.start + 2, LoopRow.ROTOR_COMMAND.start + 2])
def test_one_bad_rotor_sample_leaves_its_detector_as_it_was(column: int, bad: float) -> None:
    disturbed, quiet = Bench(), Bench()
    for bench in (disturbed, quiet):
        bench.run(1.0)
    good = disturbed.row[column]
    disturbed.row[column] = bad
    follow_rotors(disturbed.row, disturbed.rotors, disturbed.lags)
    disturbed.row[column] = good
    assert not disturbed.run(0.5) & ROTOR_FAULT
    quiet.run(0.5)
    for bench in (disturbed, quiet):
        bench.row[LoopRow.ROTOR_SPEED.start + 2] = 0.0
    for _ in range(30):
        assert disturbed.run(DT_S) == quiet.run(DT_S)
    assert disturbed.run(DT_S) & ROTOR_FAULT


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_a_deviation_before_missing_samples_is_no_rotor_fault(bad: float) -> None:
    """40 ms of deviation are forgiven if the rotor is measured afterwards, and if it is not."""
    bench = Bench()
    bench.run(1.0)
    bench.row[LoopRow.ROTOR_SPEED.start + 2] = 0.0
    bench.run(0.04)
    bench.row[LoopRow.ROTOR_SPEED.start + 2] = bad
    for _ in range(300):
        assert not bench.run(DT_S) & ROTOR_FAULT


def test_each_rotor_without_measurement_is_reported_once() -> None:
    watch = FaultDetector(VEHICLE, Behaviour(), 100.0, 5, Bench().state)
    row = Bench().row

    def run(seconds: float) -> list[int]:
        reported: list[int] = []
        for _ in range(round(seconds / DT_S)):
            for _ in range(5):
                watch.follow_rotors(row)
            watch.update(np.zeros(11), row, True, False)
            reported += watch.take_unmeasured()
        return reported

    assert run(1.0) == []
    row[LoopRow.ROTOR_SPEED.start + 2] = math.nan
    assert run(0.4) == []
    assert run(2.0) == [3]
    row[LoopRow.ROTOR_SPEED.start] = math.nan
    assert run(1.0) == [1]
    assert watch.is_quiet
    row[LoopRow.ROTOR_SPEED.start + 1] = 0.0  # another rotor is still watched
    assert run(0.5) == []
    assert Failsafe.ROTOR in watch.failsafes()


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_one_bad_rotor_sample_is_no_measurement(bad: float) -> None:
    bench = Bench()
    bench.row[LoopRow.ROTOR_SPEED] = 0.0
    bench.run(1.0)
    bench.row[LoopRow.ROTOR_SPEED.start + 1] = bad
    bench.run(DT_S)
    bench.row[LoopRow.ROTOR_SPEED.start + 1] = 0.0
    assert not bench.run(2.0) & ROTOR_FAULT


@pytest.mark.parametrize("bad", BAD_NUMBERS[:3])
def test_one_bad_state_ends_no_fault_that_was_found(bad: float) -> None:
    bench = Bench()
    bench.state[0] = 20.0
    assert bench.run(1.1) & BEYOND_POSITION
    bench.state[4] = bad
    assert bench.run(DT_S) == NOT_FINITE | BEYOND_POSITION
    bench.state[4] = 0.0
    assert bench.run(DT_S) == BEYOND_POSITION


def test_an_unknown_charge_keeps_the_level_that_was_reached() -> None:
    level = battery_level(0, 0.07, THRESHOLDS)
    level = battery_level(level, 0.08, THRESHOLDS)
    assert battery_level(battery_level(level, math.nan, THRESHOLDS), 0.08, THRESHOLDS) == level == 2


def test_moving_is_any_speed_or_rate() -> None:
    for index in (3, 4, 5, 10, 11, 12):
        bench = Bench()
        bench.state[index] = -1e-8
        assert bench.run(DT_S) == MOVING


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=72, max_size=72))
def test_no_number_breaks_the_detectors(values: list[float]) -> None:
    bench = Bench()
    bench.state[:], bench.setpoint[:], bench.row[:47] = values[:13], values[13:24], values[24:71]
    bench.run(0.1)
    assert set(bench.memory["triggered"][0].tolist()) <= {0, 1}


# ---------------------------------------------------------------------- battery

THRESHOLDS = (0.15, 0.07, 0.05)


@pytest.mark.parametrize(
    ("remaining", "level"),
    [(1.0, 0), (0.151, 0), (0.15, 1), (0.071, 1), (0.07, 2), (0.05, 3), (0.0, 3), (math.nan, 0)],
)
def test_battery_levels(remaining: float, level: int) -> None:
    assert battery_level(0, remaining, THRESHOLDS) == level


def test_a_level_is_left_only_well_above_its_threshold() -> None:
    assert battery_level(1, 0.15 + BATTERY_HYSTERESIS - 0.001, THRESHOLDS) == 1
    assert battery_level(1, 0.15 + BATTERY_HYSTERESIS + 0.001, THRESHOLDS) == 0
    assert battery_level(3, 0.06, THRESHOLDS) == 3
    assert battery_level(3, 0.075, THRESHOLDS) == 2
    assert battery_level(3, 0.5, THRESHOLDS) == 0


# ---------------------------------------------------------------------- links


def test_link_is_lost_after_its_timeout_in_vehicle_time() -> None:
    watch = SilenceTimer()
    watch.heard(5_000_000)
    assert not watch.lost(15_000_000, 10.0)
    assert watch.lost(15_000_001, 10.0)
    watch.heard(15_200_000)
    assert not watch.lost(15_300_000, 10.0)


def test_link_that_was_never_heard_is_silent_but_not_lost() -> None:
    watch = SilenceTimer()
    assert watch.silent(10**15, 10.0)
    assert not watch.lost(10**15, 10.0)
