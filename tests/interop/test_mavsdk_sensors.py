"""MAVSDK reads the sensors of a vehicle that flies on them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from mavsdk.plugins.telemetry import Health, Imu

from tests.interop.client import API, story
from tests.interop.conftest import Fleet
from tests.interop.drone import Drone
from tests.interop.stack import RealVehicle

SPEED = 4.0
"""Some ten seconds of simulated time pass until the sensors are healthy; most tests wait for MAVSDK."""


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    def start(speed: float) -> RealVehicle:
        return RealVehicle(tmp_path_factory.mktemp("sensors-"), speed, "--state", "estimated")

    fleet = Fleet(start)
    yield fleet
    fleet.stop()


def is_all_ok(health: Health) -> bool:
    return (
        health.is_gyrometer_calibration_ok
        and health.is_accelerometer_calibration_ok
        and health.is_magnetometer_calibration_ok
        and health.is_local_position_ok
        and health.is_global_position_ok
        and health.is_home_position_ok
        and health.is_armable
    )


@story(speeds=(SPEED,), links=(API,))
async def test_every_sensor_becomes_healthy(drone: Drone) -> None:
    await drone.until("health", drone.telemetry.subscribe_health(), is_all_ok)
    await drone.until("health all ok", drone.telemetry.subscribe_health_all_ok(), bool)


@story(speeds=(SPEED,), links=(API,))
async def test_sensors_of_a_standing_vehicle_are_measured(drone: Drone) -> None:
    def has_all(imu: Imu) -> bool:
        return imu.magnetic_field_frd.down_gauss != 0.0 and imu.temperature_degc != 0.0

    imu = await drone.until("imu", drone.telemetry.subscribe_imu(), has_all)
    assert imu.acceleration_frd.down_m_s2 == pytest.approx(-9.81, abs=0.3), imu
    assert abs(imu.angular_velocity_frd.forward_rad_s) < 0.1, imu
    field = imu.magnetic_field_frd
    size = math.hypot(field.forward_gauss, field.right_gauss, field.down_gauss)
    assert size == pytest.approx(0.48, abs=0.1), imu  # at Zurich
    pressure = await drone.until("pressure", drone.telemetry.subscribe_scaled_pressure())
    assert pressure.absolute_pressure_hpa == pytest.approx(956.0, abs=5.0), pressure  # at 488 m


@story(speeds=(SPEED,), links=(API,))
async def test_receiver_has_a_fix_with_accuracies(drone: Drone) -> None:
    gps = await drone.until("gps", drone.telemetry.subscribe_gps_info())
    assert gps.fix_type.value >= 3, gps
    assert 6 <= gps.num_satellites < 255, gps
    raw = await drone.until("raw gps", drone.telemetry.subscribe_raw_gps())
    position = await drone.until("position", drone.telemetry.subscribe_position())
    assert raw.latitude_deg == pytest.approx(position.latitude_deg, abs=1e-4)
    assert 0.0 < raw.horizontal_uncertainty_m < 10.0, raw
    odometry = await drone.until("odometry", drone.telemetry.subscribe_odometry())
    covariance = odometry.pose_covariance.covariance_matrix
    assert len(covariance) == 21
    assert all(covariance[at] > 0.0 for at in (0, 6, 11, 15, 18, 20)), covariance


@story(speeds=(SPEED,), links=(API,))
async def test_rates_of_sensors_may_be_set(drone: Drone) -> None:
    for name in ("imu", "scaled_imu", "gps_info"):
        drone.step(name)
        await getattr(drone.telemetry, f"set_rate_{name}")(5.0)
    scaled = await drone.until("scaled imu", drone.telemetry.subscribe_scaled_imu())
    assert scaled.acceleration_frd.down_m_s2 < 0.0, scaled
