"""MAVSDK reads the vehicle's telemetry, at the rates that it asks for."""

from __future__ import annotations

import math
import time

import pytest
from mavsdk.plugins.telemetry import Odometry, TelemetryError

from tests.interop.client import TCP, story
from tests.interop.drone import Drone

COUNTED = 40


async def seconds_between(drone: Drone, count: int) -> float:
    """Return the vehicle's time that passes while ``count`` messages with a time stamp come in."""
    stamps: list[int] = []

    def is_enough(odometry: Odometry) -> bool:
        stamps.append(odometry.time_usec)
        return len(stamps) > count

    await drone.until(f"{count} odometry messages", drone.telemetry.subscribe_odometry(), is_enough)
    assert stamps == sorted(set(stamps)), stamps
    return (stamps[-1] - stamps[0]) * 1e-6


@story(speeds=(1,), by_night=(TCP,))
async def test_messages_come_at_the_rate_asked_for(drone: Drone) -> None:
    for rate_hz in (50.0, 10.0):
        await drone.telemetry.set_rate_odometry(rate_hz)
        await seconds_between(drone, 2)  # what was on its way
        took_s = await seconds_between(drone, COUNTED)
        # in simulated time; a busy machine may leave gaps, but never sends sooner
        assert took_s >= (COUNTED - 1) / rate_hz, (rate_hz, took_s)
        assert took_s == pytest.approx(COUNTED / rate_hz, rel=0.25), rate_hz


@story(speeds=(10,))
async def test_a_fast_simulation_does_not_flood_the_client(drone: Drone) -> None:
    await drone.telemetry.set_rate_odometry(20.0)
    await seconds_between(drone, 2)
    start_s = time.monotonic()
    await seconds_between(drone, COUNTED)
    took_s = time.monotonic() - start_s
    # Streams that counted the vehicle's time would take a tenth of this, a quarter on a busy machine, which simulates
    # at 4 times real time. A message that was late at the start shortens it.
    assert took_s >= 0.5 * (COUNTED - 1) / 20.0, took_s


@story(speeds=(1,))
async def test_every_rate_may_be_set(drone: Drone) -> None:
    for name in (
        "position", "home", "in_air", "landed_state", "attitude_quaternion", "attitude_euler", "velocity_ned",
        "gps_info", "battery", "odometry", "position_velocity_ned", "unix_epoch_time", "altitude", "health",
        "actuator_output_status",
    ):  # fmt: skip
        drone.step(name)
        await getattr(drone.telemetry, f"set_rate_{name}")(5.0)


@story(speeds=(1,))
async def test_a_rate_of_what_the_vehicle_has_not_is_refused(drone: Drone) -> None:
    with pytest.raises(TelemetryError) as refused:
        await drone.telemetry.set_rate_distance_sensor(5.0)
    assert refused.value.result.name in ("UNSUPPORTED", "COMMAND_DENIED")


@story(speeds=(1,), by_night=(TCP,))
async def test_the_vehicle_tells_its_state(drone: Drone) -> None:
    telemetry = drone.telemetry
    battery = await drone.until("battery", telemetry.subscribe_battery())
    assert 0.0 < battery.remaining_percent <= 100.0, battery
    assert battery.voltage_v > 5.0, battery
    gps = await drone.until("gps", telemetry.subscribe_gps_info())
    assert gps.fix_type.name.startswith("FIX_3D") or gps.fix_type.value >= 3, gps
    raw = await drone.until("raw gps", telemetry.subscribe_raw_gps())
    position = await drone.until("position", telemetry.subscribe_position())
    assert raw.latitude_deg == pytest.approx(position.latitude_deg, abs=2e-6)
    euler = await drone.until("attitude", telemetry.subscribe_attitude_euler())
    q = await drone.until("quaternion", telemetry.subscribe_attitude_quaternion())
    assert abs(euler.roll_deg) < 1.0
    yaw_deg = math.degrees(math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2)))
    assert math.cos(math.radians(yaw_deg - euler.yaw_deg)) > 0.9999
    rates = await drone.until("rates", telemetry.subscribe_attitude_angular_velocity_body())
    assert abs(rates.roll_rad_s) < 0.01
    velocity = await drone.until("velocity", telemetry.subscribe_velocity_ned())
    assert abs(velocity.north_m_s) < 0.01
    altitude = await drone.until("altitude", telemetry.subscribe_altitude())
    assert altitude.altitude_amsl_m == pytest.approx(position.absolute_altitude_m, abs=0.05)
    heading = await drone.until("heading", telemetry.subscribe_heading())
    assert math.cos(math.radians(heading.heading_deg - euler.yaw_deg)) > 0.9999
    assert not await drone.until("on the ground", telemetry.subscribe_in_air())
    origin = await telemetry.get_gps_global_origin()
    assert origin.latitude_deg == pytest.approx(position.latitude_deg, abs=0.01)


@story(speeds=(1,))
async def test_reasons_arrive_as_texts(drone: Drone) -> None:
    texts = drone.telemetry.subscribe_status_text()
    waiting = drone.later("a text", texts, lambda text: "Armed" in text.text)
    await drone.arm()
    assert (await waiting).type.name in ("INFO", "NOTICE")
    await drone.action.disarm()
    await drone.until_disarmed()
