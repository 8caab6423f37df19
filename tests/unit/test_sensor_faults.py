"""Each fault of each sensor in a flight: what arrives in ``SensorInbox``, compared with the flight without the fault.

Sensors are ideal and the flights are equal, so that the difference is the fault itself. The tolerances are the steps
of the messages.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import FrameFinder
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    BARO,
    GYRO,
    MAG,
    HilGps,
)
from flightstack.simulator_link.sensor_inbox import FlowReport, HilReport, RangeReport, SensorInbox
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.plant.faults.table import SENSORS
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.server.failure_command import inject_failure
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import with_sensors

HOME = GeoPoint(47.397742, 8.545594, 488.0)
VEHICLE = with_sensors("ideal", imu={"rotor_imbalance_g_mm": 0.01})
BEGIN_S, END_S = 1.0, 2.5
NAMES = [name for name in SENSORS if name != "imu"]
PERIODS_S = {
    "gyro": 0.002,
    "accel": 0.002,
    "mag": 0.01,
    "baro": 0.02,
    "gnss": 0.1,
    "range": 0.02,
    "flow": 0.02,
}
STEPS = {"gyro": 1e-7, "accel": 2e-6, "mag": 1e-7, "baro": 1e-4, "gnss": 0.012, "range": 0.011, "flow": 1e-5}
"""Largest rounding of a difference: floats, and integers of 1e-7 deg, mm and cm."""
UNITS = {"gyro": math.pi / 180.0}
"""Unit of the message over that of the fault."""


CLIENT_UNITS = {
    "gyro": mavlink.FAILURE_UNIT_SENSOR_GYRO,
    "accel": mavlink.FAILURE_UNIT_SENSOR_ACCEL,
    "mag": mavlink.FAILURE_UNIT_SENSOR_MAG,
    "baro": mavlink.FAILURE_UNIT_SENSOR_BARO,
    "gnss": mavlink.FAILURE_UNIT_SENSOR_GPS,
    "range": mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR,
    "flow": mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW,
}
WRONG = {
    "gyro": "10,10,10", "accel": "2,2,2", "mag": "0.2,0.2,0.2", "baro": "5", "gnss": "30,30,0", "range": "2",
    "flow": "1,1",
}  # fmt: skip
CLIENT_FAULTS = {
    mavlink.FAILURE_TYPE_OFF: "off",
    mavlink.FAILURE_TYPE_STUCK: "freeze",
    mavlink.FAILURE_TYPE_GARBAGE: "noise={garbage}",
    mavlink.FAILURE_TYPE_WRONG: "bias={wrong}",
    mavlink.FAILURE_TYPE_DELAYED: "late=0.2",
    mavlink.FAILURE_TYPE_INTERMITTENT: "loss=0.5",
}


class Stream(NamedTuple):
    """Measurements of one sensor."""

    times_s: FloatArray
    values: FloatArray

    def since(self, begin_s: float) -> Stream:
        """Return the measurements that arrive from ``begin_s`` on."""
        late = self.times_s > begin_s - 1e-9
        return Stream(self.times_s[late], self.values[late])


def _measurements(content: Any, frame: LocalFrame) -> list[tuple[str, tuple[float, ...]]]:
    if isinstance(content, HilReport):
        values = content.values
        parts = (
            ("gyro", GYRO, values.gyro_rad_s), ("accel", ACCEL, values.accel_m_s2), ("mag", MAG, values.mag_gauss),
            ("baro", BARO, (values.pressure_hpa,)),
        )  # fmt: skip
        return [(name, part) for name, bits, part in parts if content.fields & bits == bits]
    if isinstance(content, HilGps):
        place = frame.to_ned(GeoPoint(content.latitude_deg, content.longitude_deg, content.altitude_m))
        return [("gnss", tuple(place)), ("gnss velocity", content.velocity_ned_m_s),
                ("gnss accuracy", (content.eph_m, content.fix_type, content.satellites))]  # fmt: skip
    if isinstance(content, RangeReport):
        return [("range", (content.distance_m,))]
    assert isinstance(content, FlowReport)
    return [("flow", (content.flow_rad[0] / content.dt_s, content.flow_rad[1] / content.dt_s))]


def fly(*specs: str, failure: int | None = None, vehicle=VEHICLE) -> dict[str, Stream]:
    """Return the measurements of a flight that tilts and turns; ``failure`` is that of all sensors at ``BEGIN_S``."""
    high = PlantOptions(initial=InitialState(Vector3(0.0, 0.0, -20.0)))
    simulator, inbox, finder, codec = (
        Simulator(vehicle, options=high),
        SensorInbox(),
        FrameFinder(),
        Link(1, 1),
    )
    simulator.inject(*(parse_fault(spec, 4) for spec in specs))
    assert simulator.start_sensors(HOME)
    command, frame = ActuatorsFrame(), LocalFrame(HOME)
    command.rotor_speed_rad_s[:4] = (690.2, 690.0, 691.0, 691.0)
    command.set_rotor_count(4)
    command.seal(0, ARMED_FLAG)
    found: dict[str, list[tuple[float, tuple[float, ...]]]] = {}
    while simulator.time_us < END_S * 1e6:
        for data in finder.find(bytes(simulator.outgoing())):
            is_clock = inbox.open(data)
            if is_clock is None:
                (message,) = codec.decode(data)
                is_clock = inbox.take_message(message)
            if is_clock:
                inbox.stamp(simulator.time_us)
        for report in inbox.take():
            for name, values in _measurements(report.content, frame):
                found.setdefault(name, []).append((report.time_us * 1e-6, values))
        if failure is not None and simulator.time_us == BEGIN_S * 1e6:
            for unit in CLIENT_UNITS.values():
                assert inject_failure(simulator, unit, failure, 0) == mavlink.MAV_RESULT_ACCEPTED
        simulator.apply(command)
    return {
        name: Stream(np.array([time_s for time_s, _ in rows]), np.array([values for _, values in rows]))
        for name, rows in found.items()
    }


@cache
def healthy() -> dict[str, Stream]:
    return fly()


def asked(name: str) -> tuple[str, FloatArray]:
    """Return a value of a fault as text and in the unit of the message."""
    values = [0.2, -0.1, 0.3][: SENSORS[name].components]
    return ",".join(map(str, values)), np.array(values) * UNITS.get(name, 1.0)


def compare(name: str, faulty: dict[str, Stream]) -> tuple[FloatArray, FloatArray]:
    """Return the times since the begin of the fault, and the difference to the flight without it."""
    one, other = healthy()[name], faulty[name]
    assert one.times_s.tolist() == other.times_s.tolist()
    before, since = other.times_s < BEGIN_S, other.times_s >= BEGIN_S
    assert np.array_equal(one.values[before], other.values[before])
    return other.times_s[since] - BEGIN_S, (other.values - one.values)[since]


def assert_others_are_equal(name: str, faulty: dict[str, Stream]) -> None:
    for other, stream in healthy().items():
        if not other.startswith(name):
            assert np.array_equal(stream.values, faulty[other].values), other


@pytest.mark.parametrize("name", NAMES)
def test_bias_is_the_difference_of_all_measurements(name: str) -> None:
    text, value = asked(name)
    faulty = fly(f"sensor:{name}:bias={text}@{BEGIN_S}")
    _, difference = compare(name, faulty)
    assert np.abs(difference - value).max() < STEPS[name]
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_drift_grows_with_the_time(name: str) -> None:
    text, value = asked(name)
    faulty = fly(f"sensor {name} drift {text} @{BEGIN_S}")
    since_s, difference = compare(name, faulty)
    assert np.abs(difference - np.outer(since_s, value)).max() < STEPS[name]
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_noise_has_the_spread_that_was_asked(name: str) -> None:
    faulty = fly(f"sensor:{name}:noise=0.5@{BEGIN_S}")
    _, difference = compare(name, faulty)
    spread = 0.5 * UNITS.get(name, 1.0)
    assert difference.std() == pytest.approx(spread, rel=4.0 / math.sqrt(2.0 * difference.size))
    assert abs(difference.mean()) < 4.0 * spread / math.sqrt(difference.size)
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_frozen_sensor_repeats_a_measurement_at_its_rate(name: str) -> None:
    faulty = fly(f"sensor:{name}:freeze@{BEGIN_S}")
    compare(name, faulty)
    stream = faulty[name]
    last = stream.values[stream.times_s < BEGIN_S][-1]
    assert np.all(stream.since(BEGIN_S).values == last)
    assert np.ptp(healthy()[name].since(BEGIN_S).values) > 0.0
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_sensor_drops_out_and_returns(name: str) -> None:
    faulty = fly(f"sensor:{name}:off@{BEGIN_S}-2")
    one, other = healthy()[name], faulty[name]
    kept = (one.times_s < BEGIN_S - 1e-9) | (one.times_s > 2.0 - 1e-9)
    assert other.times_s.tolist() == one.times_s[kept].tolist()
    assert np.array_equal(other.values, one.values[kept])
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_late_measurements_are_those_of_the_delay_before(name: str) -> None:
    faulty = fly(f"sensor:{name}:late=0.15@{BEGIN_S}")
    one, other = healthy()[name].since(BEGIN_S), faulty[name].since(BEGIN_S)
    assert other.times_s == pytest.approx(one.times_s[: len(other.times_s)] + 0.15)
    assert np.array_equal(other.values, one.values[: len(other.values)])
    assert other.times_s[-1] > END_S - 0.15 - PERIODS_S[name]
    assert_others_are_equal(name, faulty)


@pytest.mark.parametrize("name", NAMES)
def test_share_of_the_measurements_is_lost_at_random(name: str) -> None:
    faulty = fly(f"sensor:{name}:loss=0.4@{BEGIN_S}")
    one, other = healthy()[name].since(BEGIN_S), faulty[name].since(BEGIN_S)
    count = len(one.times_s)
    lost = 1.0 - len(other.times_s) / count
    assert lost == pytest.approx(0.4, abs=4.0 * math.sqrt(0.24 / count))
    kept = np.isin(one.times_s, other.times_s)
    assert np.array_equal(other.values, one.values[kept])
    assert_others_are_equal(name, faulty)


def test_gnss_that_is_spoofed_slowly_reports_the_velocity_of_the_spoofer() -> None:
    faulty = fly(f"sensor:gnss:drift=0.5,0,-0.2@{BEGIN_S}")
    _, velocity = compare("gnss velocity", faulty)
    assert np.abs(velocity - (0.5, 0.0, -0.2)).max() < 0.011
    _, jump = compare("gnss velocity", fly(f"sensor:gnss:bias=30,0,0@{BEGIN_S}"))
    assert not jump.any()


def test_jammed_gnss_states_its_accuracy_until_the_fix_is_lost() -> None:
    """20 satellites; half of them double noise and accuracy, 3 give no fix."""
    vehicle = with_sensors("ideal", gnss={"horizontal_noise_m": 1.0})
    clear, half, most = (
        fly(*spec, vehicle=vehicle)
        for spec in ((), (f"sensor:gnss:jam=0.5@{BEGIN_S}",), (f"sensor gnss jammed 0.85 @{BEGIN_S}",))
    )
    stated = [flight["gnss accuracy"].since(BEGIN_S).values[-1].tolist() for flight in (clear, half, most)]
    assert stated[0] == pytest.approx([math.sqrt(2.0), mavlink.GPS_FIX_TYPE_3D_FIX, 20], abs=0.006)
    assert stated[1] == pytest.approx([2.0 * math.sqrt(2.0), mavlink.GPS_FIX_TYPE_3D_FIX, 10], abs=0.006)
    assert stated[2][1:] == [mavlink.GPS_FIX_TYPE_NO_FIX, 3]
    true = healthy()["gnss"].since(BEGIN_S).values[:, :2]
    errors = [flight["gnss"].since(BEGIN_S).values[:, :2] - true for flight in (clear, half)]
    assert errors[1] == pytest.approx(2.0 * errors[0], abs=0.03)


def test_turned_magnetometer_measures_the_field_turned_back() -> None:
    """By 90° to the right: its x axis shows the field of the body's y axis."""
    one = healthy()["mag"].since(BEGIN_S).values
    other = fly(f"sensor:mag:turn=90@{BEGIN_S}")["mag"].since(BEGIN_S).values
    assert np.abs(other - np.column_stack([one[:, 1], -one[:, 0], one[:, 2]])).max() < STEPS["mag"]


def test_vibration_multiplies_what_the_rotors_shake() -> None:
    """Against a flight without vibration: the shaking is ten times the usual one."""
    still, usual = fly(f"sensor:imu:vibration=0@{BEGIN_S}"), healthy()
    shaken = fly(f"sensor imu vibration 10 @{BEGIN_S}")
    for name in ("gyro", "accel"):
        base = still[name].since(BEGIN_S).values
        once, tenfold = (flight[name].since(BEGIN_S).values - base for flight in (usual, shaken))
        assert once.std() > 20.0 * STEPS[name]
        assert tenfold == pytest.approx(10.0 * once, abs=20.0 * STEPS[name])


@pytest.mark.parametrize("failure", CLIENT_FAULTS)
def test_failures_that_a_client_injects_are_those_of_the_fault_table(failure: int) -> None:
    """INJECT_FAILURE acts from the next exchange on, as faults that begin then."""
    specs = []
    for name in NAMES:
        garbage = 10.0 * float(WRONG[name].split(",")[0])
        form = CLIENT_FAULTS[failure].format(wrong=WRONG[name], garbage=garbage)
        specs.append(f"sensor:{name}:{form}@{BEGIN_S + 0.001}")
    one, other = fly(failure=failure), fly(*specs)
    for name in healthy():
        assert np.array_equal(one[name].times_s, other[name].times_s), name
        assert np.array_equal(one[name].values, other[name].values), name
        assert (
            len(one[name].times_s) < len(healthy()[name].times_s)
            or not np.array_equal(one[name].values, healthy()[name].values)
            or name.startswith("gnss ")
        ), name
