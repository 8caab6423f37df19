"""Magnetometer, barometer, GNSS, rangefinder and optical flow, against tables, closed forms and statistics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, earth_field_ned_gauss
from flightstack.mavlink.dialect import mavlink
from flightstack.simulator_link.gps_kernels import FixRow
from sim_bridge.plant.dimensions import foot_z_m, propeller_radius_m
from sim_bridge.sensors.barometer import Barometer, pressure_altitude_m, standard_pressure_hpa
from sim_bridge.sensors.gnss import GnssReceiver
from sim_bridge.sensors.magnetometer import Magnetometer
from sim_bridge.sensors.noise import NormalStream
from sim_bridge.sensors.optical_flow import OpticalFlow
from sim_bridge.sensors.rangefinder import Rangefinder
from tests.support.sensor_vehicles import X_QUAD, state_at, with_sensors

ROWS = 1_000
HOME = GeoPoint(47.4, 8.5, 488.0)
FIELD = Vector3(0.21, 0.01, 0.43)
HIGH = state_at(position=(0.0, 0.0, -100.0))
FOOT = foot_z_m(X_QUAD)


def turned(yaw: float, pitch: float, roll: float) -> tuple[Rotation, tuple[float, ...]]:
    rotation = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    x, y, z, w = rotation.as_quat()
    return rotation, (w, x, y, z)


# ---------------------------------------------------------------------- noise


def test_rows_that_kernels_take_are_those_of_the_stream() -> None:
    """Kernels take rows of the block by its cursor, Python one by one; neither loses or repeats a row."""
    stream, random = NormalStream(3, "mag", width=3), np.random.default_rng(1)
    rows: list[FloatArray] = []
    while len(rows) < ROWS:
        for _ in range(random.integers(0, 40)):
            rows.append(stream.row().copy())  # as the simulator does
        count, at = min(int(random.integers(0, 60)), stream.ready()), int(stream.cursor[0])
        rows += list(stream.block[at : at + count].copy())
        stream.cursor[0] += count
    other = NormalStream(3, "mag", width=3)
    expected = np.concatenate([other.rows(256) for _ in range(5)])
    assert np.array_equal(rows[:ROWS], expected[:ROWS])


# ---------------------------------------------------------------------- magnetometer


@pytest.mark.parametrize(
    ("height_km", "latitude", "longitude", "field"),
    [
        (0.0, 80.0, 0.0, (6521.6, 145.9, 54791.5)),
        (0.0, 0.0, 120.0, (39677.8, -109.6, -10580.2)),
        (0.0, -80.0, 240.0, (6117.5, 15751.9, -52022.5)),
        (100.0, 80.0, 0.0, (6216.0, 92.4, 52598.8)),
        (100.0, 0.0, 120.0, (37688.6, -96.2, -10152.1)),
    ],
)
def test_earth_field_is_that_of_noaas_test_values(height_km, latitude, longitude, field) -> None:
    """WMM2025_TEST_VALUES.txt of NOAA, in nT, for 2025.0."""
    place = GeoPoint(latitude, longitude, height_km * 1e3)
    assert earth_field_ned_gauss(place, 2025.0) == pytest.approx(np.array(field) * 1e-5, abs=1e-6)  # 0.1 nT


def test_ideal_magnetometer_measures_the_field_in_the_body_frame() -> None:
    rotation, attitude = turned(0.7, -0.3, 0.2)
    sensor = Magnetometer(with_sensors(), 1, FIELD)
    sensor.measure(state_at(attitude=attitude), 10.0)
    assert sensor.records[0]["out"] == pytest.approx(rotation.inv().apply(FIELD), abs=1e-14)


def test_magnetometer_feels_iron_and_current() -> None:
    numbers = {"hard_iron_gauss": 0.1, "soft_iron": 0.05, "current_gauss_a": 0.001}
    sensor = Magnetometer(with_sensors(mag=numbers), 1, FIELD)
    mag = sensor.records[0]
    for current in (0.0, 20.0):
        sensor.measure(state_at(), current)
        assert mag["out"] == pytest.approx(
            mag["matrix"] @ np.array(FIELD) + mag["offset"] + mag["per_ampere"] * current, abs=1e-14
        )
    assert np.abs(mag["matrix"] - np.eye(3)).max() > 0.01
    assert np.abs(mag["offset"]).max() > 0.01
    assert np.abs(mag["per_ampere"]).max() > 1e-4


def test_magnetometer_noise_is_white_with_its_spread() -> None:
    sensor = Magnetometer(with_sensors(mag={"noise_gauss": 0.002}), 1, FIELD)
    out = np.empty((5000, 3))
    for row in out:
        sensor.measure(state_at(), 0.0)
        row[:] = sensor.records[0]["out"]
    assert out.std(axis=0) / 0.002 == pytest.approx([1.0] * 3, abs=4.0 / math.sqrt(2.0 * 5000))
    assert out.mean(axis=0) == pytest.approx(FIELD, abs=4.0 * 0.002 / math.sqrt(5000))
    apart = [np.corrcoef(column[:-1], column[1:])[0, 1] for column in out.T]
    assert np.abs(apart).max() < 4.0 / math.sqrt(5000)


# ---------------------------------------------------------------------- barometer


@pytest.mark.parametrize(
    ("altitude_m", "pressure_hpa"),
    [(-500.0, 1074.78), (0.0, 1013.25), (1000.0, 898.746), (5000.0, 540.199), (11000.0, 226.320)],
)
def test_pressure_is_that_of_the_standard_atmosphere(altitude_m: float, pressure_hpa: float) -> None:
    """ISO 2533, by geopotential altitude; the table has five digits."""
    assert standard_pressure_hpa(altitude_m) == pytest.approx(pressure_hpa, rel=1e-5)
    assert pressure_altitude_m(standard_pressure_hpa(altitude_m)) == pytest.approx(altitude_m, abs=1e-8)


def baro(
    vehicle, state=HIGH, airspeed: float = 0.0, speed: float = 0.0, altitude: float = 500.0
) -> np.ndarray:
    sensor = Barometer(vehicle, 1, altitude)
    sensor.measure(0, state, airspeed, np.full(8, speed, dtype="f4"))
    return sensor.records[0]["out"].copy()


def test_ideal_barometer_gives_altitude_and_temperature() -> None:
    """100 m above a home of 500 m; 6.5 K per km."""
    out = baro(with_sensors())
    assert out[1] == pytest.approx(600.0, abs=1e-8)
    assert out[2] == pytest.approx(15.0 - 0.0065 * 600.0)


def test_barometer_feels_its_share_of_the_dynamic_pressure() -> None:
    """12 m/s at sea level: ½·1.225·144 = 88.2 Pa."""
    sea = state_at(position=(0.0, 0.0, -100.0))
    still, blown = (
        baro(with_sensors(baro={"dynamic_share": -0.1}), sea, speed, altitude=-100.0)[0]
        for speed in (0.0, 12.0)
    )
    assert blown - still == pytest.approx(-0.1 * 0.882, rel=1e-5)


def test_barometer_feels_the_downwash_near_the_ground() -> None:
    """The share of the disc loading at half a radius of a rotor, a quarter of it at one radius."""
    radius, speed = propeller_radius_m(X_QUAD), 650.0
    thrust = X_QUAD.rotors[0].thrust_coefficient_n_s2 * speed**2
    loading_hpa = 0.01 * thrust / (math.pi * radius**2)
    vehicle = with_sensors(baro={"ground_effect_share": 0.2})
    for height, share in ((0.5 * radius, 0.2), (radius, 0.05), (0.1 * radius, 0.2)):
        at = state_at(position=(0.0, 0.0, FOOT - height))
        assert baro(vehicle, at, 0.0, speed)[0] - baro(vehicle, at)[0] == pytest.approx(share * loading_hpa)


def test_barometer_drift_has_the_covariance_of_a_gauss_markov_process() -> None:
    """σ²·exp(−|t| / T) at lags of 0, ½ and 1 T, from 2000 correlation times."""
    rate, time_s, spread = 5.0, 2.0, 0.1
    sensor = Barometer(
        with_sensors(baro={"rate_hz": rate, "drift_hpa": spread, "drift_time_s": time_s}), 1, 0.0
    )
    drift = np.empty(20_000)
    for index in range(len(drift)):
        sensor.measure(index * 200_000, HIGH, 0.0, np.zeros(8, dtype="f4"))
        drift[index] = sensor.records[0]["out"][0] - standard_pressure_hpa(100.0)
    for lag in (0, 5, 10):
        covariance = np.mean(drift[: len(drift) - lag] * drift[lag:])
        expected = spread**2 * math.exp(-lag / rate / time_s)
        assert covariance == pytest.approx(expected, abs=0.13 * spread**2)  # 4 √(2T / 4000 s)


def test_drift_of_a_barometer_follows_the_time_between_its_samples() -> None:
    """Sampled at 1 Hz in slow exchanges, at a rate of 5 Hz: the correlation time is still 2 s."""
    numbers = {"rate_hz": 5.0, "drift_hpa": 0.1, "drift_time_s": 2.0}
    sensor, drift = Barometer(with_sensors(baro=numbers), 1, 0.0), np.empty(10_000)
    for index in range(len(drift)):
        out = sensor.measure(index * 1_000_000, HIGH, 0.0, np.zeros(8, dtype="f4"))
        drift[index] = out[0] - standard_pressure_hpa(100.0)
    correlation = np.mean(drift[:-1] * drift[1:]) / np.mean(drift * drift)
    assert correlation == pytest.approx(math.exp(-0.5), abs=0.04)  # with the step of 5 Hz: 0.90


# ---------------------------------------------------------------------- GNSS


def receiver_of(grade: str = "ideal", **numbers: float) -> GnssReceiver:
    """Return a receiver without latency, with other numbers."""
    return GnssReceiver(with_sensors(grade, gnss={"latency_s": 0.0, **numbers}), 1, HOME)


def fixes(receiver: GnssReceiver, count: int, begin_us: int = 0) -> list[tuple[int, FixRow]]:
    """Return the fixes of a receiver at rest, as (time, fix)."""
    found = []
    for time_us in range(begin_us, begin_us + 100_000 * count, 100_000):
        sent = receiver.receive(time_us, state_at())
        assert sent is not None
        found.append((time_us, FixRow(*sent.tolist())))
    return found


def test_gnss_errors_are_white_and_correlated_as_given() -> None:
    """Autocovariance of the position: white² at lag 0 only, drift²·exp(−t / T) at every lag; velocity is white."""
    numbers = {
        "horizontal_noise_m": 0.3, "horizontal_drift_m": 0.5, "vertical_noise_m": 0.6, "vertical_drift_m": 0.8,
        "drift_time_s": 1.0, "velocity_noise_m_s": 0.05, "vertical_velocity_noise_m_s": 0.08,
    }  # fmt: skip
    receiver = receiver_of(**numbers)
    out = np.empty((20_000, 6))
    for index in range(len(out)):
        receiver.receive(index * 100_000, state_at())
        out[index] = receiver.records[0]["out"]
    for axis, (white, drift) in enumerate([(0.3, 0.5), (0.3, 0.5), (0.6, 0.8)]):
        column = out[:, axis]
        within = (
            4.0 * drift**2 * math.sqrt(2.0 * 1.0 / 2000.0)
        )  # of a covariance, from 2000 correlation times
        for lag in (0, 5, 10):
            expected = drift**2 * math.exp(-0.1 * lag) + (white**2 if lag == 0 else 0.0)
            assert np.mean(column[: len(column) - lag] * column[lag:]) == pytest.approx(expected, abs=within)
    assert out[:, 3:].std(axis=0) / (0.05, 0.05, 0.08) == pytest.approx(
        [1.0] * 3, abs=4.0 / math.sqrt(40_000)
    )


@pytest.mark.parametrize("latency_s", [0.0, 0.06, 0.11, 0.35])
def test_a_fix_is_sent_once_after_its_latency(latency_s: float) -> None:
    """The state moves north by 1 m/s, so that a fix shows the time of its measurement."""
    receiver, sent_us = receiver_of(latency_s=latency_s), []
    for time_us in range(0, 1_000_001, 20_000):
        sent = receiver.receive(time_us, state_at(velocity=(time_us * 1e-6, 0.0, 0.0)))
        if sent is not None:
            sent_us.append((time_us, round(FixRow(*sent.tolist()).north_m_s * 1e6)))
    steps_us = 20_000 * math.ceil(latency_s * 50.0 - 1e-9)
    expected = [(measured + steps_us, measured) for measured in range(0, 1_000_001 - steps_us, 100_000)]
    assert sent_us == expected


@pytest.mark.parametrize("step_us", [2000, 15_000, 18_000, 20_000, 100_000, 170_000])
@pytest.mark.parametrize("rate_hz", [0.7, 7.0, 10.0, 33.0, 45.0, 50.0])
@pytest.mark.parametrize("latency_s", [0.0, 0.019, 0.11, 2.0])
def test_fixes_wait_at_any_rate_latency_and_step(rate_hz: float, latency_s: float, step_us: int) -> None:
    """Each is sent at the first step after its latency, or replaced by a newer one."""
    receiver, waiting = receiver_of(rate_hz=rate_hz, latency_s=latency_s), []
    period_us, latency_us, next_us = round(1e6 / rate_hz), round(latency_s * 1e6), 0
    for time_us in range(0, 3_000_000, step_us):
        if time_us >= next_us:
            next_us = (time_us // period_us + 1) * period_us
            waiting.append(time_us)
        over = [measured for measured in waiting if measured + latency_us <= time_us]
        waiting = waiting[len(over) :]
        sent = receiver.receive(time_us, state_at(velocity=(time_us * 1e-6, 0.0, 0.0)))
        assert (sent is not None) is bool(over)
        assert sent is None or round(FixRow(*sent.tolist()).north_m_s * 1e6) == over[-1]


def test_gnss_states_the_standard_deviations_of_its_errors() -> None:
    numbers = {
        "horizontal_noise_m": 0.3, "horizontal_drift_m": 0.4, "vertical_noise_m": 0.6, "vertical_drift_m": 0.8,
    }  # fmt: skip
    (_, fix), *_ = fixes(receiver_of(**numbers), 3)
    assert (fix.eph_m, fix.epv_m) == (pytest.approx(math.sqrt(2.0) * 0.5), pytest.approx(1.0))


def test_gnss_has_no_fix_before_its_first_one() -> None:
    found = fixes(receiver_of(first_fix_s=1.0), 20)
    kinds = [(time_us < 1_000_000, fix.fix_type) for time_us, fix in found]
    no_fix, fix_3d = mavlink.GPS_FIX_TYPE_NO_FIX, mavlink.GPS_FIX_TYPE_3D_FIX
    assert {kind for early, kind in kinds if early} == {no_fix}
    assert {kind for early, kind in kinds if not early} == {fix_3d}


def test_jammed_gnss_loses_satellites_accuracy_and_at_last_the_fix() -> None:
    receiver = receiver_of("consumer")
    _, clear = fixes(receiver, 40)[-1]
    receiver.jam(0.5)
    _, jammed = fixes(receiver, 40, begin_us=4_000_000)[-1]
    assert (clear.satellites, jammed.satellites) == (14, 7)
    assert jammed.eph_m == pytest.approx(2.0 * clear.eph_m)
    assert jammed.fix_type == mavlink.GPS_FIX_TYPE_3D_FIX
    receiver.jam(0.8)
    _, lost = fixes(receiver, 40, begin_us=8_000_000)[-1]
    assert (lost.satellites, lost.fix_type) == (3, mavlink.GPS_FIX_TYPE_NO_FIX)


# ---------------------------------------------------------------------- rangefinder and flow


def test_rangefinder_measures_along_its_axis() -> None:
    """At a tilt of 30° the ground is 1/cos 30° as far; the mounting is 5 cm below the origin."""
    sensor = Rangefinder(with_sensors(range={"position_frd_m": (0.0, 0.0, 0.05)}))
    for angle in (0.0, math.radians(30.0)):
        _, attitude = turned(1.0, 0.0, angle)
        sensor.measure(state_at(position=(3.0, 2.0, FOOT - 10.0), attitude=attitude))
        assert sensor.records[0]["out"] == pytest.approx([10.0 / math.cos(angle) - 0.05, 1.0], abs=1e-12)


def test_rangefinder_out_of_range_has_no_echo() -> None:
    sensor = Rangefinder(with_sensors(range={"min_m": 0.3, "max_m": 8.0}))
    _, over = turned(0.0, 0.0, math.radians(70.0))
    for state in (
        state_at(position=(0.0, 0.0, FOOT - 9.0)),
        state_at(position=(0.0, 0.0, FOOT - 0.2)),
        state_at(position=(0.0, 0.0, FOOT - 1.0), attitude=over),
    ):
        sensor.measure(state)
        assert sensor.records[0]["out"].tolist() == [8.0, 0.0]


def test_rangefinder_noise_grows_with_the_distance() -> None:
    sensor = Rangefinder(with_sensors(range={"noise_m": 0.03, "noise_share": 0.01}))
    for height, expected in ((1.0, math.hypot(0.03, 0.01)), (20.0, math.hypot(0.03, 0.2))):
        out = np.empty(4000)
        for index in range(len(out)):
            sensor.measure(state_at(position=(0.0, 0.0, FOOT - height)))
            out[index] = sensor.records[0]["out"][0]
        assert out.std() / expected == pytest.approx(1.0, abs=4.0 / math.sqrt(8000.0))


def test_optical_flow_is_the_motion_of_the_ground_below_the_lens() -> None:
    """A point of the ground on the axis, seen again after 1 µs of flight: its angle about the body's axes."""
    rotation, attitude = turned(0.8, 0.2, -0.3)
    position, velocity = np.array([4.0, 5.0, FOOT - 7.0]), np.array([3.0, -2.0, 1.0])
    rates, dt = np.array([0.5, -0.4, 0.7]), 1e-6
    axis = rotation.apply([0.0, 0.0, 1.0])
    ground = position + axis * (FOOT - position[2]) / axis[2]
    later = (rotation * Rotation.from_rotvec(rates * dt)).inv().apply(ground - position - velocity * dt)
    # the point moves against the turn of the body
    expected = np.array([later[1] / later[2], -later[0] / later[2]]) / dt
    sensor = OpticalFlow(with_sensors())
    sensor.measure(state_at(position, velocity, attitude, rates))
    assert sensor.records[0]["out"] == pytest.approx([*expected, 1.0], abs=1e-5)


def test_optical_flow_near_the_ground_has_no_quality() -> None:
    sensor = OpticalFlow(with_sensors(flow={"min_height_m": 0.1}))
    sensor.measure(state_at(position=(0.0, 0.0, FOOT - 0.05), velocity=(1.0, 0.0, 0.0)))
    assert sensor.records[0]["out"].tolist() == [0.0, 0.0, 0.0]
