"""The simulator with a client that behaves as PX4: sensors without a request, answers after a start of its own."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GYRO, MAG
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.server.connection import PeerClosedError
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.server.session import Pace, Session
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import X_QUAD, with_sensors

HOME = GeoPoint(47.397742, 8.545594, 488.0)
START_STEPS = 30
STEPS = 800


class Px4:
    """PX4's end of the connection, as measured: one heartbeat, one request, and no answer in its first steps.

    It answers each HIL_SENSOR of id 0 with the same time, climbs, and closes the connection after ``STEPS``.
    """

    def __init__(self) -> None:
        self.codec = Link(1, 1)
        self.received: list[Any] = []
        self.answers = 0
        self._steps = 0
        request = mavlink.MAVLink_command_long_message(
            0, 0, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 5000,
            0, 0, 0, 0, 0,
        )  # fmt: skip
        heartbeat = mavlink.MAVLink_heartbeat_message(0, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
        self._pending = [self.codec.encode(request), self.codec.encode(heartbeat)]

    def send(self, data: bytes) -> None:
        """Take what the simulator sends."""
        for message in self.codec.decode(bytes(data)):
            self.received.append(message)
            if message.get_type() == "HIL_SENSOR" and message.id == 0:
                self._steps += 1
                if self._steps > START_STEPS:
                    self._answer(message.time_usec)

    def _answer(self, time_us: int) -> None:
        self.answers += 1
        controls = mavlink.MAVLink_hil_actuator_controls_message(time_us, [0.5] * 4 + [0.0] * 12, 129, 1)
        self._pending.append(self.codec.encode(controls))

    def receive(self) -> memoryview:
        """Return the bytes that wait, and close the connection at the end."""
        assert self._pending, "the simulator waits for an answer that PX4 does not send"
        if self._steps >= STEPS:
            raise PeerClosedError
        return memoryview(self._pending.pop(0))

    def receive_within(self, _timeout_s: float) -> memoryview | None:
        """Return the bytes that wait, or None."""
        return memoryview(self._pending.pop(0)) if self._pending else None


class Running:
    """A signal that does not stop."""

    stopped = False

    def is_set(self) -> bool:
        """Return False."""
        return False


def flown(vehicle=X_QUAD, *specs: str) -> Px4:
    simulator, px4 = Simulator(vehicle), Px4()
    simulator.inject(*(parse_fault(spec, 4) for spec in specs))
    session = Session(FlightStackEndpoint(simulator, vehicle, HOME), px4, Pace(math.inf), Running())  # type: ignore[arg-type]
    with pytest.raises(PeerClosedError):
        session.run()
    return px4


def of_type(px4: Px4, name: str) -> list[Any]:
    return [message for message in px4.received if message.get_type() == name]


def test_px4_is_not_waited_for_until_its_answers_begin() -> None:
    px4 = flown()
    times = [message.time_usec for message in of_type(px4, "HIL_SENSOR")]
    assert times == [5000 * step for step in range(1, STEPS + 1)]  # above zero, none twice, none left out
    assert px4.answers == STEPS - START_STEPS


def test_px4_receives_every_group_of_fields_and_the_truth() -> None:
    px4 = flown()
    sensors = of_type(px4, "HIL_SENSOR")
    assert all(m.fields_updated & (ACCEL | GYRO) == ACCEL | GYRO for m in sensors)
    assert sum(m.fields_updated & MAG == MAG for m in sensors) == pytest.approx(400, abs=1)  # 100 Hz in 4 s
    assert sum(m.fields_updated & BARO == BARO for m in sensors) == pytest.approx(200, abs=1)
    assert {m.id for m in sensors} == {0}
    assert len(of_type(px4, "HIL_GPS")) == pytest.approx(39, abs=1)  # 10 Hz, late by 110 ms
    assert len(of_type(px4, "HIL_STATE_QUATERNION")) == STEPS


def test_clock_of_px4_precedes_what_it_stamps_with_it() -> None:
    """PX4 stamps a second inertial sensor, GPS and truth with the newest HIL_SENSOR of id 0."""
    received = flown(with_sensors("consumer", imu={"count": 2.0})).received
    clock_us = 0
    for message in received:
        if message.get_type() == "HIL_SENSOR" and message.id == 0:
            clock_us = message.time_usec
        elif message.get_type() in ("HIL_SENSOR", "HIL_GPS", "HIL_STATE_QUATERNION"):
            assert message.time_usec == clock_us
    assert sum(message.get_type() == "HIL_GPS" for message in received) > 30


def test_px4_climbs_in_the_simulator() -> None:
    """Control 0.5 is half of the thrust of 2.2 weights: a climb with 0.1 g, seen by each sensor."""
    px4 = flown(with_sensors("ideal"))
    fix, sensor = of_type(px4, "HIL_GPS")[-1], of_type(px4, "HIL_SENSOR")[-1]
    truth = of_type(px4, "HIL_STATE_QUATERNION")[-1]
    assert truth.alt - 488_000 > 4_000
    assert fix.alt == pytest.approx(truth.alt, abs=500)  # up to 0.1 s older at 3.5 m/s
    assert fix.vd == pytest.approx(truth.vz, abs=15)
    assert sensor.pressure_alt == pytest.approx(truth.alt * 1e-3, abs=0.1)
    assert sensor.zacc == pytest.approx(-1.1 * 9.81, abs=0.8)  # less drag


def test_values_have_noise_so_that_px4s_voter_accepts_them() -> None:
    """PX4 takes a sensor for stale after 100 equal values."""
    sensors = of_type(flown(), "HIL_SENSOR")[:START_STEPS]
    assert len({(m.xacc, m.yacc, m.zacc) for m in sensors}) > 20
    assert len({m.abs_pressure for m in sensors if m.fields_updated & BARO}) > 5


RECORDED_FIELDS = {0x3F: 667, 0x1FF: 333, 0x1A3F: 167, 0x1BFF: 84}
"""``fields_updated`` of 1251 HIL_SENSOR at 250 Hz in a flight of PX4 (f2471861, none_iris): IMU alone, with mag at
125 Hz, with baro at 50 Hz, with both. HIL_GPS came at 10 Hz, HIL_STATE_QUATERNION in every second step."""
RECORDED_REST = {
    "xacc": 0.0644, "yacc": 0.0725, "zacc": -9.8033, "xgyro": -0.0023, "ygyro": -0.0033, "zgyro": 0.0001,
    "xmag": 0.2132, "ymag": 0.0048, "zmag": 0.4278,
    "abs_pressure": 955.985, "diff_pressure": 0.0, "pressure_alt": 488.0,
}  # fmt: skip
"""First HIL_SENSOR of this simulator, level at rest, heading north, at ``HOME``."""
RECORDED_FIX = {
    "lat": 473977419,
    "lon": 85455910,
    "alt": 487866,
    "fix_type": 3,
    "satellites_visible": 10,
    "id": 0,
    "yaw": 0,
}
ROUNDING = {
    "xacc": 0.15, "yacc": 0.15, "zacc": 0.15, "xgyro": 0.02, "ygyro": 0.02, "zgyro": 0.02,
    "xmag": 0.015, "ymag": 0.03, "zmag": 0.015, "abs_pressure": 2.0, "diff_pressure": 0.0, "pressure_alt": 17.0,
}  # fmt: skip
"""Errors of both simulators' sensors; ours has a barometer with an offset of 0.5 hPa (1 sigma)."""


def test_messages_agree_with_those_of_a_recorded_flight_of_px4() -> None:
    """Groups of fields, ids, order, units and signs, against the simulator that flew PX4."""
    px4 = flown()
    sensors, fixes = of_type(px4, "HIL_SENSOR"), of_type(px4, "HIL_GPS")
    assert {message.fields_updated for message in sensors} <= set(RECORDED_FIELDS)
    first = next(message for message in sensors if message.fields_updated == 0x1BFF)
    for name, value in RECORDED_REST.items():
        assert getattr(first, name) == pytest.approx(value, abs=ROUNDING[name]), name
    fix = next(fix for fix in fixes if fix.fix_type == RECORDED_FIX["fix_type"])
    assert (fix.id, fix.yaw) == (RECORDED_FIX["id"], RECORDED_FIX["yaw"])
    assert fix.lat == pytest.approx(RECORDED_FIX["lat"], abs=300)  # 3 m
    assert fix.lon == pytest.approx(RECORDED_FIX["lon"], abs=300)
    assert 50 < fix.eph < 300  # cm, as PX4 reads it: 90 in the record; epv 120
    assert 50 < fix.epv < 300
    assert 0 <= fix.cog < 36000
    order = [message.get_type() for message in px4.received]
    kinds = ("HIL_SENSOR", "HIL_GPS", "HIL_STATE_QUATERNION")  # of a step, in the recorded order
    ranks = [kinds.index(kind) for kind in order if kind in kinds]
    assert all(later in (0, rank + 1, 2) for rank, later in pairwise(ranks))


def test_dead_gps_is_seen_by_px4() -> None:
    assert of_type(flown(X_QUAD, "sensor:gnss:off"), "HIL_GPS") == []
