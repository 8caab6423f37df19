"""Sensors at any place on Earth: near the poles, at the date line, on the equator, and at 4000 m."""

from __future__ import annotations

import math

import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.link import Link
from flightstack.simulator_link.sensor_frames import BARO, MAG
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import with_sensors

# home, and the pressure there by the table of ISO 2533, hPa
PLACES = {
    "arctic": (GeoPoint(89.5, 20.0, 0.0), 1013.25),
    "antarctic": (GeoPoint(-89.0, -120.0, 2800.0), 719.1),
    "date line": (GeoPoint(-17.0, 179.9999, 10.0), 1012.05),
    "equator": (GeoPoint(0.0, 0.0, 0.0), 1013.25),
    "high plateau": (GeoPoint(-16.5, -68.15, 4000.0), 616.40),
}
OFFSET = Vector3(60.0, 80.0, -5.0)


@pytest.mark.parametrize("name", PLACES)
def test_magnetometer_and_barometer_measure_at_any_place(name: str) -> None:
    home, pressure_hpa = PLACES[name]
    options = PlantOptions(initial=InitialState(OFFSET), ground=False)
    simulator, codec = Simulator(with_sensors("ideal"), options=options), Link(1, 1)
    simulator.start_sensors(home)
    (sensor,) = (m for m in codec.decode(bytes(simulator.outgoing())) if m.get_type() == "HIL_SENSOR")
    assert sensor.fields_updated & (MAG | BARO) == MAG | BARO
    assert sensor.abs_pressure == pytest.approx(pressure_hpa - 0.12 * 5.0, rel=1e-3)
    assert sensor.pressure_alt == pytest.approx(home.altitude_m + 5.0, abs=0.01)
    size = math.hypot(sensor.xmag, sensor.ymag, sensor.zmag)
    assert 0.22 < size < 0.67  # the Earth's field


@pytest.mark.parametrize("name", PLACES)
def test_gnss_is_within_a_step_of_the_true_position(name: str) -> None:
    """The vehicle is 100 m from home: east of the date line its longitude is negative."""
    home, _ = PLACES[name]
    options = PlantOptions(initial=InitialState(OFFSET), ground=False)
    simulator, codec = Simulator(with_sensors("ideal"), options=options), Link(1, 1)
    simulator.start_sensors(home)
    (fix,) = (m for m in codec.decode(bytes(simulator.outgoing())) if m.get_type() == "HIL_GPS")
    assert -1_800_000_000 <= fix.lon <= 1_800_000_000
    assert -900_000_000 <= fix.lat <= 900_000_000
    place = LocalFrame(home).to_ned(GeoPoint(fix.lat * 1e-7, fix.lon * 1e-7, fix.alt * 1e-3))
    assert place == pytest.approx(OFFSET, abs=0.012)
    assert (fix.lon < 0) == (name in ("antarctic", "date line", "high plateau"))
