"""A vehicle that flies on its sensors: messages of PX4's contract as samples for an estimator."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.sensor_feed import SensorFeed, sample_of, slow_samples
from flightstack.estimation.sensor_samples import (
    BaroSample,
    FlowSample,
    GnssFix,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GYRO, MAG
from flightstack.simulator_link.sensor_inbox import MOST_WAITING, HilReport
from sim_bridge.server.endpoint import FlightStackEndpoint
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import X_QUAD, with_sensors

HOME = GeoPoint(47.397742, 8.545594, 488.0)
UNIX_US = 1_790_000_000_000_000
ALL_BITS = 0x1BFF  # of jMAVSim, in every message


def stack() -> SimulatorEndpoint:
    return SimulatorEndpoint(X_QUAD, HOME, lockstep=True, uses_sensors=True)


def receive(link: SimulatorEndpoint, *data: bytes) -> bool:
    return link.receive(memoryview(b"".join(data)))


def taken(link: SimulatorEndpoint) -> list[tuple[int, Any]]:
    """Return the new samples, each with the number of its sensor."""
    assert link.sensors is not None
    return [pair for time_us, content in link.sensors.take() for pair in pairs_of(time_us * 1e-6, content)]


def pairs_of(time_s: float, content: Any) -> Iterator[tuple[int, Any]]:
    """Yield the samples of a message with the number of the sensor."""
    if not isinstance(content, HilReport):
        yield getattr(content, "number", 0), sample_of(time_s, content)
        return
    if content.fields & (ACCEL | GYRO) == ACCEL | GYRO and content.step_us > 0:
        rates, forces = Vector3(*content.values.gyro_rad_s), Vector3(*content.values.accel_m_s2)
        yield content.number, ImuSample(time_s, content.step_us * 1e-6, rates, forces)
    for sample in slow_samples(time_s, content):
        yield content.number, sample


def hil_sensor(time_us: int, fields: int = ALL_BITS, number: int = 0) -> Any:
    return mavlink.MAVLink_hil_sensor_message(
        time_us, 0.5, -0.25, -9.75, 0.125, 0.25, -0.5, 0.25, 0.0, 0.5, 950.5, 0.0, 536.5, 12.5, fields, number
    )


def hil_gps(time_us: int) -> Any:
    return mavlink.MAVLink_hil_gps_message(
        time_us, 3, 473977420, 85455940, 488500, 60, 90, 200, 150, -100, 50, 0, 12
    )


# ---------------------------------------------------------------------- this simulator


def connected(vehicle=X_QUAD) -> tuple[SimulatorEndpoint, FlightStackEndpoint]:
    """Return both ends after the requests."""
    link, simulator = stack(), FlightStackEndpoint(Simulator(vehicle), vehicle, HOME)
    simulator.receive(memoryview(link.initial_requests(2000)))
    receive(link, *simulator.replies())
    return link, simulator


def exchange(link: SimulatorEndpoint, simulator: FlightStackEndpoint, speed: float = 0.0) -> None:
    """Send a state, answer it, and advance the simulator."""
    assert link.receive(memoryview(bytes(simulator.state())))
    simulator.receive(memoryview(bytes(link.answer(np.full(8, speed), armed=True))))
    assert simulator.answered
    simulator.step()


def test_vehicle_on_sensors_flies_in_lockstep_with_this_simulator() -> None:
    link, simulator = connected()
    for step in range(300):
        exchange(link, simulator, 700.0)
        assert link.time_us == 2000 * step
    assert simulator.simulator.frame.state[2] < -0.1
    assert (simulator.stale, simulator.bad) == (0, 0)
    assert not link.request_refused


def test_truth_is_kept_beside_the_state() -> None:
    link, simulator = connected()
    assert link.known_truth() is None
    for _ in range(300):
        exchange(link, simulator, 700.0)
    assert link.known_truth() is link.truth
    assert link.truth[2] < -0.1
    assert link.truth.tolist() != simulator.simulator.frame.state.tolist()  # one step older
    assert link.state.tolist() == [0.0] * 6 + [1.0] + [0.0] * 6  # for the estimator to write


def test_samples_have_the_measurements_of_the_simulator() -> None:
    """Ideal sensors in a climb: sample by sample, against the state of the simulator."""
    link, simulator = connected(with_sensors("ideal"))
    previous = simulator.simulator.frame.state.copy()
    counts: dict[type, int] = {}
    for step in range(500):
        state = simulator.simulator.frame.state.copy()
        exchange(link, simulator, 680.0)
        for number, sample in taken(link):
            counts[type(sample)] = counts.get(type(sample), 0) + 1
            assert (number, sample.time_s) == (0, pytest.approx(step * 2e-3))
            if isinstance(sample, ImuSample):
                up = (state[5] - previous[5]) / 2e-3 - 9.81
                assert sample.dt_s == pytest.approx(2e-3)
                assert sample.accel_frd_m_s2.z == pytest.approx(up, abs=2e-6)
            elif isinstance(sample, BaroSample):
                assert sample.pressure_altitude_m == pytest.approx(488.0 - state[2], abs=1e-3)
            elif isinstance(sample, GnssSample):
                assert sample.altitude_msl_m == pytest.approx(488.0 - state[2], abs=2e-3)
                assert sample.velocity_ned_m_s.z == pytest.approx(state[5], abs=6e-3)
                assert sample.fix_type == GnssFix.FIX_3D
            elif isinstance(sample, RangeSample):
                assert sample.distance_m == pytest.approx(0.2 - state[2], abs=6e-3)
            elif isinstance(sample, FlowSample):
                assert sample.flow_x_rad == pytest.approx(0.0, abs=1e-7)
        previous = state
    assert counts == {
        ImuSample: 499, MagSample: 100, BaroSample: 50, GnssSample: 10, RangeSample: 50, FlowSample: 50,
    }  # fmt: skip


def test_second_inertial_sensor_has_its_number_and_the_same_time() -> None:
    link, simulator = connected(with_sensors("consumer", imu={"count": 2.0}))
    exchange(link, simulator)
    taken(link)
    exchange(link, simulator)
    imus = [(number, sample) for number, sample in taken(link) if isinstance(sample, ImuSample)]
    assert [number for number, _ in imus] == [1, 0]
    assert imus[0][1].time_s == imus[1][1].time_s == 2e-3
    assert imus[0][1] != imus[1][1]


def test_battery_is_reported_beside_the_sensors() -> None:
    link, simulator = connected()
    exchange(link, simulator)
    assert link.battery.valid
    assert link.battery.remaining == 1.0


def test_frames_cut_anywhere_are_the_same_samples() -> None:
    """TCP has no boundaries: the same bytes in pieces give the same samples, in the same order."""
    simulator = Simulator(with_sensors("consumer"))
    simulator.start_sensors(HOME)
    command, data = ActuatorsFrame(), b""
    command.set_rotor_count(4)
    command.seal(0, ARMED_FLAG)
    for _ in range(80):
        data += bytes(simulator.outgoing())
        simulator.apply(command)
    whole, pieces = stack(), stack()
    receive(whole, data)
    expected = taken(whole)
    assert len(expected) > 30
    for at in range(0, len(data), 37):
        receive(pieces, data[at : at + 37])
    assert taken(pieces) == expected


def test_untaken_reports_are_bounded() -> None:
    link, codec = stack(), Link(1, 51)
    for step in range(1, 3 * MOST_WAITING):
        receive(link, codec.encode(hil_gps(step)), codec.encode(hil_sensor(step * 4000)))
    for _ in range(2 * MOST_WAITING):
        receive(link, codec.encode(hil_gps(0)))
    assert link.sensors is not None
    assert len(link.sensors.take()) == MOST_WAITING


# ---------------------------------------------------------------------- other simulators


@pytest.mark.parametrize("first_us", [4000, UNIX_US])  # Gazebo classic, jMAVSim
def test_simulator_with_px4s_contract_alone_is_flown(first_us: int) -> None:
    """No FS_PLANT_STATE: each HIL_SENSOR is answered by HIL_ACTUATOR_CONTROLS of the same time."""
    link, codec = stack(), Link(1, 51)
    for step in range(5):
        now_us = first_us + 4000 * step
        assert receive(link, codec.encode(hil_gps(7)), codec.encode(hil_sensor(now_us)))
        (answer,) = codec.decode(bytes(link.answer(np.full(8, 400.0), armed=True)))
        assert (answer.get_type(), answer.time_usec, answer.flags) == ("HIL_ACTUATOR_CONTROLS", now_us, 1)
        assert link.time_us == 4000 * step
        assert link.known_truth() is None
        samples = [sample for _, sample in taken(link)]
        gps = next(sample for sample in samples if isinstance(sample, GnssSample))
        assert gps.time_s == pytest.approx(4e-3 * step)  # of its reception
        assert gps[1:4] == pytest.approx((47.397742, 8.545594, 488.5))
        assert (gps.velocity_ned_m_s, gps.eph_m, gps.epv_m) == ((1.5, -1.0, 0.5), 0.6, 0.9)
        assert math.isnan(gps.speed_accuracy_m_s)
        imus = [sample for sample in samples if isinstance(sample, ImuSample)]
        assert len(imus) == (step > 0)  # the first one has no duration
        if imus:
            assert imus[0] == ImuSample(
                4e-3 * step, 4e-3, Vector3(0.125, 0.25, -0.5), Vector3(0.5, -0.25, -9.75)
            )
        assert MagSample(samples[0].time_s, Vector3(0.25, 0.0, 0.5)) in samples
        assert BaroSample(samples[0].time_s, 950.5, 536.5, 12.5) in samples


def test_truth_of_other_simulators_drives_no_time() -> None:
    link, codec = stack(), Link(1, 51)
    truth = mavlink.MAVLink_hil_state_quaternion_message(
        9000, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 473977420, 85455940, 498000, 100, 0, 0, 0, 0, 0, 0, 0
    )
    assert link.known_truth() is None
    assert not receive(link, codec.encode(truth))
    assert not link.has_state
    assert link.known_truth() is link.truth
    assert link.truth[2] == pytest.approx(-10.0)
    assert link.truth[3] == 1.0
    assert receive(link, codec.encode(hil_sensor(4000)))
    assert link.has_state


def test_mavlink_1_simulator_is_understood() -> None:
    link, codec = stack(), mavlink.MAVLink(None, 1, 51)
    for step in range(1, 3):
        assert link.receive(memoryview(bytes(hil_sensor(4000 * step).pack(codec, force_mavlink1=True))))
    assert [type(sample) for _, sample in taken(link)].count(ImuSample) == 1


def test_group_without_all_its_bits_is_no_sample() -> None:
    """As PX4: a group of which a bit is missing is not new."""
    for fields, kinds in (
        (ACCEL | GYRO, [ImuSample]),
        (GYRO | MAG, [MagSample]),
        (ACCEL | BARO & ~mavlink.HIL_SENSOR_UPDATED_TEMPERATURE, []),
        (0, []),
    ):
        link, codec = stack(), Link(1, 51)
        receive(link, codec.encode(hil_sensor(4000, fields)))
        taken(link)
        receive(link, codec.encode(hil_sensor(8000, fields)))
        assert [type(sample) for _, sample in taken(link)] == kinds


def test_distance_and_flow_of_other_simulators_are_samples() -> None:
    link, codec = stack(), Link(1, 51)
    down, forward = mavlink.MAV_SENSOR_ROTATION_PITCH_270, mavlink.MAV_SENSOR_ROTATION_NONE
    for distance, orientation in ((250, down), (300, forward), (4000, down)):
        message = mavlink.MAVLink_distance_sensor_message(1, 20, 1000, distance, 0, 0, orientation, 255)
        receive(link, codec.encode(message))
    flow = mavlink.MAVLink_hil_optical_flow_message(
        1, 0, 20_000, 0.5, -0.25, 0.125, 0.0, 0.25, 0, 255, 0, -1.0
    )
    receive(link, codec.encode(flow), codec.encode(hil_sensor(4000)))
    samples = [sample for _, sample in taken(link)]
    assert samples[:3] == [
        RangeSample(0.0, 2.5, 1.0),
        RangeSample(0.0, 40.0, 0.0),
        FlowSample(0.0, 0.02, 0.5, -0.25, Vector3(0.125, 0.0, 0.25), 1.0),
    ]


def test_clock_that_goes_back_gives_samples_without_duration() -> None:
    link, codec = stack(), Link(1, 51)
    receive(link, codec.encode(hil_sensor(8000)))
    receive(link, codec.encode(hil_sensor(12_000)))
    taken(link)
    receive(link, codec.encode(hil_sensor(4000)))
    assert not any(isinstance(sample, ImuSample) for _, sample in taken(link))
    assert (link.time_us, link.time_jumps) == (4000, 1)


def test_lost_inertial_measurements_lengthen_the_next_one() -> None:
    """The samples of an integrating filter cover the time that passed."""
    link, codec = stack(), Link(1, 51)
    for step, fields in enumerate((ALL_BITS, ALL_BITS, ACCEL | BARO, 0, ALL_BITS, ALL_BITS), 1):
        receive(link, codec.encode(hil_sensor(4000 * step, fields)))
    imus = [sample for _, sample in taken(link) if isinstance(sample, ImuSample)]
    assert [sample.time_s for sample in imus] == pytest.approx([0.004, 0.016, 0.020])
    assert [sample.dt_s for sample in imus] == pytest.approx([0.004, 0.012, 0.004])


def test_untaken_inertial_measurements_lengthen_the_next_one() -> None:
    link, codec = stack(), Link(1, 51)
    for step in range(1, 202):
        receive(
            link,
            codec.encode(hil_sensor(4000 * step, number=1)),
            codec.encode(hil_sensor(4000 * step)),
        )
    samples = [(number, one.dt_s) for number, one in taken(link) if isinstance(one, ImuSample)]
    for number in (0, 1):
        assert sum(dt_s for own, dt_s in samples if own == number) == pytest.approx(0.8)


def test_second_inertial_sensor_after_the_clock_has_its_time() -> None:
    """As a simulator for PX4 sends it; the time of its reception would be one step too late."""
    link, codec = stack(), Link(1, 51)
    for step in (1, 2):
        receive(
            link,
            codec.encode(hil_sensor(4000 * step)),
            codec.encode(hil_sensor(4000 * step, number=1)),
        )
    imus = [(number, one.time_s, one.dt_s) for number, one in taken(link) if isinstance(one, ImuSample)]
    assert imus == [(0, 0.004, 0.004), (1, 0.004, 0.004)]


# ---------------------------------------------------------------------- the estimator's seam


STATE = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.6, 0.0, 0.8, 0.0, 0.1, 0.2, 0.3]


class Notebook:
    """An estimator that records its samples."""

    def __init__(self) -> None:
        self.frame: LocalFrame | None = None
        self.aligned = False
        self.samples: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        return self.samples.append

    def imu_row(self, row: FloatArray) -> None:
        self.samples.append(ImuSample(row[0], row[1], Vector3(*row[2:5]), Vector3(*row[5:])))

    def write_state(self, state: FloatArray) -> None:
        state[:] = STATE


def test_feed_writes_the_estimate_once_it_is_known() -> None:
    link, codec, notebook = stack(), Link(1, 51), Notebook()
    feed = SensorFeed(notebook, link.state)
    assert link.sensors is not None

    def step(time_us: int, number: int = 0) -> bool:
        receive(link, codec.encode(hil_sensor(time_us, number=number)), codec.encode(hil_sensor(time_us)))
        assert link.sensors is not None
        return feed.update(link.sensors.take())

    assert not step(4000)
    assert link.state[6] == 1.0  # not aligned: the state is not written
    notebook.aligned = True
    assert not step(8000)  # attitude alone
    notebook.frame = LocalFrame(HOME)
    assert step(12_000)
    assert link.state.tolist() == STATE


def test_feed_takes_the_first_sensor_of_each_kind() -> None:
    link, codec, notebook = stack(), Link(1, 51), Notebook()
    feed = SensorFeed(notebook, link.state)
    assert link.sensors is not None
    for step in range(1, 4):
        receive(link, codec.encode(hil_sensor(4000 * step, number=1)), codec.encode(hil_sensor(4000 * step)))
        feed.update(link.sensors.take())
    assert [type(sample) for sample in notebook.samples].count(ImuSample) == 2
    assert [type(sample) for sample in notebook.samples].count(MagSample) == 3


@pytest.mark.parametrize(
    ("field", "kind"),
    [("xgyro", ImuSample), ("zacc", ImuSample), ("ymag", MagSample), ("pressure_alt", BaroSample)],
)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_measurement_that_is_not_finite_is_none(field: str, kind: type, value: float) -> None:
    """The filter would drop it and the sensor would not count as missing: the estimate stood still in flight."""
    link, codec, notebook = stack(), Link(1, 51), Notebook()
    feed = SensorFeed(notebook, link.state)
    for step in range(1, 5):
        message = hil_sensor(4000 * step)
        if step == 3:
            setattr(message, field, value)
        receive(link, codec.encode(message))
        assert link.sensors is not None
        feed.update(link.sensors.take())
        if step == 3:
            assert feed.lanes[0].measured_us == (4000 if kind is ImuSample else 8000)
    times = [sample.time_s for sample in notebook.samples if isinstance(sample, kind)]
    assert 0.008 not in times  # the first one is at 0
    assert times[-1] == 0.012
