"""Sensors of a simulator: messages, rates, faults, and the failures that a client injects."""

from __future__ import annotations

import math
from typing import Any

import pytest

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GYRO, MAG
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.sensors.faults import channels_of
from sim_bridge.server.failure_command import inject_failure
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import X_QUAD, with_sensors

HOME = GeoPoint(47.397742, 8.545594, 488.0)
IDEAL = with_sensors("ideal")


def command(speed: float = 0.0) -> ActuatorsFrame:
    frame = ActuatorsFrame()
    frame.rotor_speed_rad_s[:4] = speed
    frame.set_rotor_count(4)
    frame.seal(0, ARMED_FLAG)
    return frame


class Bench:
    """A simulator with sensors, and the messages that it sends in each exchange."""

    def __init__(self, vehicle=IDEAL, *specs: str, interval_us: int = 2000) -> None:
        self.simulator = Simulator(vehicle)
        self.simulator.inject(*(parse_fault(spec, 4) for spec in specs))
        self.simulator.set_interval_us(interval_us)
        assert self.simulator.start_sensors(HOME)
        self.codec = Link(1, 1)

    def run(self, seconds: float, speed: float = 0.0) -> list[list[Any]]:
        """Return the messages of each exchange."""
        sent = []
        for _ in range(round(seconds * 1e6 / self.simulator.interval_us)):
            sent.append([one for one in self.codec.decode(bytes(self.simulator.outgoing())) if one])
            self.simulator.apply(command(speed))
        return sent


def of_type(exchanges: list[list[Any]], name: str) -> list[Any]:
    return [message for messages in exchanges for message in messages if message.get_type() == name]


# ---------------------------------------------------------------------- messages


def test_each_exchange_ends_with_the_first_inertial_sensor() -> None:
    """Its time is the vehicle's clock: the truth and all other sensors of this instant precede it."""
    for messages in Bench(with_sensors("ideal", imu={"count": 3.0})).run(0.3):
        names = [message.get_type() for message in messages]
        assert names[-3:] == ["HIL_SENSOR"] * 3
        assert [message.id for message in messages[-3:]] == [2, 1, 0]
        assert "FS_PLANT_STATE" in names
        truth = messages[names.index("FS_PLANT_STATE")]
        assert {message.time_usec for message in messages[-3:]} == {truth.time_us}


def test_sensors_are_sent_at_their_rates() -> None:
    """HIL_SENSOR in each exchange with the bits of what is new: mag 100 Hz, baro 50 Hz; GNSS 10 Hz."""
    exchanges = Bench().run(2.0)
    sensor = of_type(exchanges, "HIL_SENSOR")
    assert len(sensor) == 1000
    assert all(message.fields_updated & (ACCEL | GYRO) == ACCEL | GYRO for message in sensor)
    assert sum(message.fields_updated & MAG == MAG for message in sensor) == 200
    assert sum(message.fields_updated & BARO == BARO for message in sensor) == 100
    assert {message.fields_updated & ~(ACCEL | GYRO | MAG | BARO) for message in sensor} == {0}
    assert len(of_type(exchanges, "HIL_GPS")) == 20
    assert len(of_type(exchanges, "DISTANCE_SENSOR")) == len(of_type(exchanges, "HIL_OPTICAL_FLOW")) == 100


def test_slow_exchanges_keep_the_rates_of_slower_sensors() -> None:
    """At 250 Hz, as Gazebo classic and jMAVSim, and at 30 Hz, slower than mag and baro."""
    quarter = of_type(Bench(interval_us=4000).run(1.0), "HIL_SENSOR")
    assert (len(quarter), sum(m.fields_updated & BARO == BARO for m in quarter)) == (250, 50)
    slow = of_type(Bench(interval_us=33_333).run(1.0), "HIL_SENSOR")
    assert all(m.fields_updated == ACCEL | GYRO | MAG | BARO for m in slow)


def test_ideal_sensors_report_the_vehicle_at_rest() -> None:
    exchanges = Bench().run(1.0)
    last = [m for m in of_type(exchanges, "HIL_SENSOR") if m.fields_updated & BARO][-1]
    assert (last.xacc, last.yacc, last.zacc) == pytest.approx((0.0, 0.0, -9.81), abs=1e-6)
    assert last.pressure_alt == pytest.approx(488.0, abs=1e-3)
    assert math.hypot(last.xmag, last.ymag, last.zmag) == pytest.approx(0.4836, abs=1e-4)
    fix = of_type(exchanges, "HIL_GPS")[-1]
    assert (fix.lat, fix.lon, fix.alt) == (473977420, 85455940, 488000)
    assert (fix.fix_type, fix.satellites_visible, fix.vel) == (mavlink.GPS_FIX_TYPE_3D_FIX, 20, 0)
    (distance, *_) = of_type(exchanges, "DISTANCE_SENSOR")
    assert distance.current_distance == 20  # the legs
    assert distance.orientation == mavlink.MAV_SENSOR_ROTATION_PITCH_270


def test_optical_flow_message_has_the_angles_over_its_interval() -> None:
    """A climb of 1 s; then the flow about each axis is that of rates and velocity."""
    bench = Bench()
    exchanges = bench.run(1.5, 700.0)
    flow = of_type(exchanges, "HIL_OPTICAL_FLOW")[-1]
    assert flow.integration_time_us == 20_000
    assert flow.integrated_x == pytest.approx(flow.integrated_xgyro, abs=1e-6)
    assert flow.quality == 255


def test_same_seed_gives_the_same_bytes() -> None:
    def sent(seed: int) -> bytes:
        vehicle = with_sensors("consumer")
        simulator = Simulator(vehicle, options=PlantOptions(seed=seed))
        simulator.start_sensors(HOME)
        data = b""
        for _ in range(300):
            data += bytes(simulator.outgoing())
            simulator.apply(command(600.0))
        return data

    assert sent(1) == sent(1)
    assert sent(1) != sent(2)


def test_sensors_do_not_change_the_flight() -> None:
    plain, measured = Simulator(X_QUAD), Simulator(X_QUAD)
    measured.start_sensors(HOME)
    for _ in range(200):
        plain.apply(command(680.0))
        measured.apply(command(680.0))
    assert plain.frame.state.tobytes() == measured.frame.state.tobytes()


def test_vehicle_without_sensors_sends_none() -> None:
    simulator = Simulator(X_QUAD.__class__(**{**X_QUAD.__dict__, "sensors": type(X_QUAD.sensors)()}))
    assert not simulator.start_sensors(HOME)
    assert simulator.sensors is None


# ---------------------------------------------------------------------- faults


def after(spec: str, name: str, vehicle=IDEAL, seconds: float = 2.0) -> tuple[list[Any], list[Any]]:
    """Return the messages before and after a fault that begins at 1 s."""
    exchanges = Bench(vehicle, f"{spec}@1").run(seconds)
    begin = 500
    return of_type(exchanges[:begin], name), of_type(exchanges[begin:], name)


def test_sensor_that_is_off_sends_nothing() -> None:
    before, since = after("sensor:gyro:off", "HIL_SENSOR")
    assert all(m.fields_updated & GYRO == GYRO for m in before)
    assert not any(m.fields_updated & GYRO for m in since)
    assert all(m.fields_updated & ACCEL == ACCEL for m in since)
    assert len(since) == 500  # the clock goes on
    assert after("sensor:gnss:off", "HIL_GPS")[1] == []
    assert not any(m.fields_updated & MAG for m in after("sensor mag off", "HIL_SENSOR")[1])
    assert not any(m.fields_updated & BARO for m in after("sensor baro off", "HIL_SENSOR")[1])
    assert after("sensor:range:off", "DISTANCE_SENSOR")[1] == []


def test_second_imu_fails_alone() -> None:
    two = with_sensors("ideal", imu={"count": 2.0})
    _, since = after("sensor:imu2:off", "HIL_SENSOR", two)
    assert {(m.id, m.fields_updated & (ACCEL | GYRO)) for m in since} == {(0, ACCEL | GYRO), (1, 0)}


def test_drift_begins_when_it_is_injected() -> None:
    bench = Bench()
    before = of_type(bench.run(1.0), "HIL_SENSOR")[0]
    bench.simulator.inject(parse_fault("sensor:baro:drift=1", 4))
    first = [m for m in of_type(bench.run(0.1), "HIL_SENSOR") if m.fields_updated & BARO][-1]
    assert 0.0 < first.abs_pressure - before.abs_pressure < 0.11


@pytest.mark.parametrize(("late_s", "exact_s"), [(0.004, 0.004), (0.025, 0.026)])
def test_delay_is_rounded_up_to_an_exchange_alone(late_s: float, exact_s: float) -> None:
    """A barometer at 50 Hz, exchanges at 500 Hz: its messages keep their rate, and come between its measurements."""
    exchanges = Bench(IDEAL, f"sensor:baro:late={late_s}@1", "sensor:baro:drift=1@1").run(2.0)
    sent = [m for m in of_type(exchanges[500:], "HIL_SENSOR") if m.fields_updated & BARO]
    still = of_type(exchanges, "HIL_SENSOR")[0].abs_pressure
    ages = [m.time_usec * 1e-6 - 1.0 - (m.abs_pressure - still) for m in sent]
    assert ages == pytest.approx([exact_s] * len(sent), abs=1e-4)  # a float of 950 hPa has steps of 6e-5
    assert len(sent) == pytest.approx(50, abs=2)


def test_gnss_message_is_late_by_the_latency() -> None:
    """A spoofed position that moves at 10 m/s is 1.2 m behind."""
    vehicle = with_sensors("ideal", gnss={"latency_s": 0.12})
    fixes = of_type(Bench(vehicle, "sensor:gnss:drift=10,0,0").run(2.0), "HIL_GPS")
    assert len(fixes) == 19  # the last one is on its way
    for fix in fixes:
        north_m = LocalFrame(HOME).to_ned(GeoPoint(fix.lat * 1e-7, fix.lon * 1e-7, fix.alt * 1e-3)).x
        assert 10.0 * fix.time_usec * 1e-6 - north_m == pytest.approx(1.2, abs=0.02)  # steps of 1e-7 deg


def test_drift_goes_on_when_another_fault_begins_and_ends() -> None:
    exchanges = Bench(IDEAL, "sensor:gyro:drift=10,0,0", "sensor:mag:off@0.5-0.6").run(1.0)
    rates = [math.degrees(m.xgyro) for m in of_type(exchanges, "HIL_SENSOR")]
    assert rates == pytest.approx([0.02 * step for step in range(500)], abs=1e-5)


def test_sensor_that_is_frozen_from_the_start_has_a_measurement() -> None:
    frozen = ("sensor:baro:freeze", "sensor:mag:freeze", "sensor:imu:freeze", "sensor:range:freeze")
    exchanges = Bench(IDEAL, *frozen).run(0.2)
    last = [m for m in of_type(exchanges, "HIL_SENSOR") if m.fields_updated & BARO][-1]
    assert last.pressure_alt == pytest.approx(488.0, abs=1e-3)
    assert last.zacc == pytest.approx(-9.81, abs=1e-6)
    assert math.hypot(last.xmag, last.ymag, last.zmag) == pytest.approx(0.4836, abs=1e-4)
    assert of_type(exchanges, "DISTANCE_SENSOR")[-1].current_distance == 20


def test_losses_of_a_sensor_do_not_depend_on_another_sensor() -> None:
    def received(*specs: str) -> list[bool]:
        sent = of_type(Bench(IDEAL, "sensor:gyro:loss=0.5", *specs).run(0.5), "HIL_SENSOR")
        return [bool(m.fields_updated & GYRO) for m in sent]

    assert received() == received("sensor:mag:loss=0.5", "sensor:accel:loss=0.5")


def test_sensor_recovers_at_the_end_of_a_fault() -> None:
    exchanges = Bench(IDEAL, "sensor:imu:off@0.5-1", "sensor:baro:bias=5@0.5-1").run(1.5)
    last = [m for m in of_type(exchanges, "HIL_SENSOR") if m.fields_updated & BARO][-1]
    assert last.fields_updated & (ACCEL | GYRO) == ACCEL | GYRO
    assert last.pressure_alt == pytest.approx(488.0, abs=1e-3)


@pytest.mark.parametrize(
    ("sensor", "channels"),
    [
        ("mag", [("mag", 0)]),
        ("gyro", [("gyro", 0), ("gyro", 1)]),
        ("gyro2", [("gyro", 1)]),
        ("imu2", [("gyro", 1), ("accel", 1)]),
        ("", []),
    ],
)
def test_fault_names_its_channels(sensor: str, channels: list[tuple[str, int]]) -> None:
    assert channels_of(sensor, 2) == channels


@pytest.mark.parametrize(
    ("spec", "problem"),
    [
        ("sensor:range:off", "the vehicle x_quad has no such sensor"),
        ("sensor:imu2:off", "the vehicle x_quad has inertial sensors 1 to 1"),
    ],
)
def test_fault_of_a_sensor_that_is_not_there_is_refused(spec: str, problem: str) -> None:
    with pytest.raises(UsageProblemError, match=problem):
        Simulator(X_QUAD).inject(parse_fault(spec, 4))


def test_vibration_of_rotors_without_imbalance_is_refused() -> None:
    with pytest.raises(UsageProblemError, match="the rotors of the vehicle x_quad have no imbalance"):
        Simulator(IDEAL).inject(parse_fault("sensor:imu:vibration=10", 4))


# ---------------------------------------------------------------------- failures that a client injects

ACCEPTED, DENIED, UNSUPPORTED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_UNSUPPORTED,
)


def test_client_turns_a_sensor_off_and_on() -> None:
    bench = Bench()
    off, ok = mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_OK
    for unit, name, bits in (
        (mavlink.FAILURE_UNIT_SENSOR_GYRO, "HIL_SENSOR", GYRO),
        (mavlink.FAILURE_UNIT_SENSOR_ACCEL, "HIL_SENSOR", ACCEL),
        (mavlink.FAILURE_UNIT_SENSOR_MAG, "HIL_SENSOR", MAG),
        (mavlink.FAILURE_UNIT_SENSOR_BARO, "HIL_SENSOR", BARO),
    ):
        for failure, is_sent in ((off, False), (ok, True)):
            assert inject_failure(bench.simulator, unit, failure, 0) == ACCEPTED
            sent = of_type(bench.run(0.2)[1:], name)
            assert any(m.fields_updated & bits for m in sent) == is_sent
    for unit, name in (
        (mavlink.FAILURE_UNIT_SENSOR_GPS, "HIL_GPS"),
        (mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR, "DISTANCE_SENSOR"),
        (mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW, "HIL_OPTICAL_FLOW"),
    ):
        for failure, is_sent in ((off, False), (ok, True)):
            assert inject_failure(bench.simulator, unit, failure, 1) == ACCEPTED
            assert bool(of_type(bench.run(0.4)[1:], name)) == is_sent


def test_injected_failure_without_effect_is_answered() -> None:
    simulator = Bench(X_QUAD).simulator
    off = mavlink.FAILURE_TYPE_OFF
    assert inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_GYRO, off, 2) == DENIED
    assert inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR, off, 0) == DENIED
    assert inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_MAG, 2.5, 0) == UNSUPPORTED
    assert (
        inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_MAG, mavlink.FAILURE_TYPE_SLOW, 0)
        == UNSUPPORTED
    )
    assert inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_AIRSPEED, off, 0) == UNSUPPORTED
    assert inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_MAG, off, math.nan) == DENIED
    assert simulator.faults == ()


def test_client_ends_a_fault_of_all_sensors_on_one_of_them() -> None:
    """The gyro of the second inertial sensor recovers; its accelerometer and the other gyro stay off."""
    bench = Bench(with_sensors("ideal", imu={"count": 2.0}), "sensor:imu:off")
    unit, ok = mavlink.FAILURE_UNIT_SENSOR_GYRO, mavlink.FAILURE_TYPE_OK
    assert inject_failure(bench.simulator, unit, ok, 2) == ACCEPTED
    sent = of_type(bench.run(0.1)[1:], "HIL_SENSOR")
    assert {(m.id, m.fields_updated & (ACCEL | GYRO)) for m in sent} == {(0, 0), (1, GYRO)}
    assert inject_failure(bench.simulator, unit, ok, 0) == ACCEPTED
    sent = of_type(bench.run(0.1)[1:], "HIL_SENSOR")
    assert {(m.id, m.fields_updated & (ACCEL | GYRO)) for m in sent} == {(0, GYRO), (1, GYRO)}


def test_failure_of_a_sensor_is_unsupported_on_the_true_state() -> None:
    off = mavlink.FAILURE_TYPE_OFF
    assert inject_failure(Simulator(X_QUAD), mavlink.FAILURE_UNIT_SENSOR_GPS, off, 0) == UNSUPPORTED


def test_new_failure_of_a_sensor_replaces_the_old_one() -> None:
    simulator = Bench(X_QUAD).simulator
    unit = mavlink.FAILURE_UNIT_SENSOR_MAG
    inject_failure(simulator, unit, mavlink.FAILURE_TYPE_OFF, 0)
    inject_failure(simulator, mavlink.FAILURE_UNIT_SENSOR_BARO, mavlink.FAILURE_TYPE_OFF, 0)
    inject_failure(simulator, unit, mavlink.FAILURE_TYPE_STUCK, 0)
    assert sorted((fault.sensor, fault.kind.value) for fault in simulator.faults) == [
        ("baro", "sensor off"),
        ("mag", "sensor freeze"),
    ]
