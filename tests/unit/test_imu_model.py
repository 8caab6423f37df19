"""Inertial sensors: against strapdown integration, Allan deviations, covariances and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.sensors.imu import ImuSet
from sim_bridge.simulator import Simulator
from tests.support.sensor_vehicles import X_QUAD, state_at, with_sensors

G = 9.81
STILL = np.zeros(8, dtype="f4")
WIRES = np.zeros((3, 6), dtype="f4")


def imus(vehicle, state=None, dt_s: float = 0.002, seed: int = 1) -> ImuSet:
    sensors = ImuSet(vehicle, seed, state_at() if state is None else state)
    sensors.set_step(dt_s)
    return sensors


def rows(sensors: ImuSet, count: int, state=None, speeds=STILL) -> np.ndarray:
    """Return measurements of the first sensor, shape (count, 6)."""
    at = state_at() if state is None else state
    out = np.empty((count, 6))
    for index in range(count):
        sensors.measure(at, speeds, WIRES[: len(sensors.records)])
        out[index] = sensors.records[0]["out"]
    return out


# ---------------------------------------------------------------------- the motion


def test_ideal_imu_integrates_to_attitude_and_velocity_of_a_flight() -> None:
    """Strapdown integration by SciPy's rotations follows 10 s of tumbling flight; the mounting is off centre."""
    mounting = np.array([0.06, -0.04, 0.03])
    vehicle = with_sensors(imu={"position_frd_m": tuple(mounting)})
    gusty = PlantOptions(Disturbance(gust_m_s=4.0, torque_gust_n_m=0.05), ground=False)
    simulator, command = Simulator(vehicle, options=gusty), ActuatorsFrame()
    command.rotor_speed_rad_s[:4] = (660.0, 650.0, 655.0, 657.0)
    command.set_rotor_count(4)
    command.seal(0, ARMED_FLAG)
    state = simulator.frame.state
    sensors = imus(vehicle, state)

    def of_mounting() -> np.ndarray:
        return state[3:6] + attitude().apply(np.cross(state[10:13], mounting))

    def attitude() -> Rotation:
        return Rotation.from_quat(state[[7, 8, 9, 6]])

    turned, velocity = attitude(), of_mounting()
    for _ in range(5000):
        simulator.apply(command)
        sensors.measure(state, simulator.frame.rotor_speed_rad_s, WIRES[:1])
        out = sensors.records[0]["out"]
        step = Rotation.from_rotvec(out[:3] * 0.002)
        middle = turned * Rotation.from_rotvec(out[:3] * 0.001)
        velocity = velocity + (middle.apply(out[3:]) + np.array([0.0, 0.0, G])) * 0.002
        turned = turned * step
    assert np.linalg.norm(state[10:13]) > 0.5  # it tumbles
    assert (turned.inv() * attitude()).magnitude() < 1e-12  # measured 1.2e-14
    assert np.abs(velocity - of_mounting()).max() < 1e-11  # measured 2.3e-13


def test_imu_at_rest_measures_gravity_in_any_attitude() -> None:
    turned = Rotation.from_euler("ZYX", [0.4, -0.7, 1.2])
    x, y, z, w = turned.as_quat()
    out = rows(imus(with_sensors(), state_at(attitude=(w, x, y, z))), 3, state_at(attitude=(w, x, y, z)))
    assert out[-1, :3] == pytest.approx([0.0] * 3, abs=1e-12)
    assert out[-1, 3:] == pytest.approx(turned.inv().apply([0.0, 0.0, -G]), abs=1e-12)


def test_imu_off_centre_feels_the_turn() -> None:
    """A steady turn about z at ω: −ω²·r towards the axis, as a mean over the step times sinc(ω·dt/2)."""
    omega, dt = 5.0, 0.002
    vehicle = with_sensors(imu={"position_frd_m": (0.1, 0.0, 0.0)})

    def at(angle: float) -> np.ndarray:
        return state_at(
            attitude=(math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)), rates=(0.0, 0.0, omega)
        )

    sensors = imus(vehicle, at(0.0))
    sensors.measure(at(omega * dt), STILL, WIRES[:1])
    expected = -omega * omega * 0.1 * math.sin(omega * dt / 2) / (omega * dt / 2)
    assert sensors.records[0]["out"] == pytest.approx([0.0, 0.0, omega, expected, 0.0, -G], abs=1e-10)


# ---------------------------------------------------------------------- vibration


def test_vibration_is_that_of_the_rotating_imbalance() -> None:
    """Each rotor pushes with U·Ω²: RMS over many turns, averaged over the step, and no drift."""
    speed, dt, imbalance = 656.0, 0.002, 2.0
    vehicle = with_sensors(imu={"rotor_imbalance_g_mm": imbalance})
    speeds = np.array([speed, 0, 0, 0, 0, 0, 0, 0], dtype="f4")
    out = rows(imus(vehicle), 20_000, speeds=speeds)
    push = imbalance * 1e-6 * speed**2 / X_QUAD.mass_kg
    mean = abs(math.sin(speed * dt / 2) / (speed * dt / 2))
    expected = push * mean / math.sqrt(2.0)
    assert out[:, 3].std() == pytest.approx(expected, rel=1e-4)  # measured 2e-5
    assert out[:, 4].std() == pytest.approx(expected, rel=1e-4)
    # torque about z: the force across the arm of 0.25 m, integrated to a rate: U·Ω·r / I, averaged again
    arm = math.hypot(*X_QUAD.rotors[0].position_frd_m[:2])
    rate = imbalance * 1e-6 * speed * arm / X_QUAD.inertia_kg_m2[2] * mean / math.sqrt(2.0)
    assert out[:, 2].std() == pytest.approx(rate, rel=1e-4)
    swing = np.cumsum(out[:, 3:5], axis=0) * dt
    assert np.abs(swing).max() < 2.0 * push / speed * 1.01  # bounded by the swing of the velocity


def test_rotors_at_rest_do_not_vibrate() -> None:
    out = rows(imus(with_sensors(imu={"rotor_imbalance_g_mm": 2.0})), 100)
    assert np.ptp(out, axis=0).max() == 0.0


# ---------------------------------------------------------------------- errors


def allan_variance(values: np.ndarray, group: int) -> float:
    means = values[: len(values) // group * group].reshape(-1, group).mean(axis=1)
    return float(0.5 * np.mean(np.diff(means) ** 2))


@pytest.mark.parametrize("group", [1, 10, 100])
def test_white_noise_has_the_allan_deviation_of_its_density(group: int) -> None:
    """σ²(τ) = N²/τ, from 40 000 samples of each axis; the spread of an Allan variance of n means is √(3/n)."""
    dt, gyro, accel = 0.002, 0.004, 9.8e-4
    vehicle = with_sensors(imu={"gyro_noise_deg_s_sqrt_hz": gyro, "accel_noise_m_s2_sqrt_hz": accel})
    out = rows(imus(vehicle), 40_000)
    spread = math.sqrt(3.0 / (3 * 40_000 / group))  # three axes
    for columns, density in ((out[:, :3], math.radians(gyro)), (out[:, 3:], accel)):
        measured = np.mean([allan_variance(column, group) for column in columns.T])
        assert measured * group * dt / density**2 == pytest.approx(1.0, abs=4.0 * spread)


def test_wandering_bias_has_the_allan_variance_of_a_gauss_markov_process() -> None:
    """σ²(τ) = (σT/τ)²·(2τ/T − 3 + 4·e^(−τ/T) − e^(−2τ/T)), at three times around the correlation time T."""
    dt, time_s, spread = 0.05, 2.0, 0.01
    vehicle = with_sensors(imu={"accel_bias_instability_m_s2": spread, "bias_time_s": time_s})
    out = rows(imus(vehicle, dt_s=dt), 80_000)[:, 3:]
    for group in (10, 40, 160):
        tau = group * dt
        ratio = tau / time_s
        factor = 2.0 * ratio - 3.0 + 4.0 * math.exp(-ratio) - math.exp(-2.0 * ratio)
        expected = (spread / ratio) ** 2 * factor
        measured = np.mean([allan_variance(column, group) for column in out.T])
        assert measured == pytest.approx(
            expected, rel=0.15
        )  # measured within 0.7 %; three axes, 500 means: 5 %


def test_turn_on_errors_have_their_spread_over_vehicles() -> None:
    """Of 300 seeds: bias, scale and misalignment have the standard deviations of the file."""
    given = {
        "gyro_turn_on_bias_deg_s": 0.2, "accel_turn_on_bias_m_s2": 0.03,
        "gyro_scale_error": 0.002, "accel_scale_error": 0.003, "misalignment_deg": 0.2,
    }  # fmt: skip
    vehicle = with_sensors(imu=given)
    made = [ImuSet(vehicle, seed, state_at()).records[0].copy() for seed in range(300)]
    bias = np.array([imu["turn_on"] for imu in made])
    matrix = np.array([imu["matrix"] for imu in made]) - np.eye(3)
    diagonal = np.diagonal(matrix, axis1=2, axis2=3)
    off = matrix[:, :, ~np.eye(3, dtype=bool)]
    within = pytest.approx(1.0, abs=4.0 / math.sqrt(2.0 * 900))  # 900 values each
    assert bias[:, :3].std() / math.radians(0.2) == within
    assert bias[:, 3:].std() / 0.03 == within
    assert diagonal[:, 0].std() / 0.002 == within
    assert diagonal[:, 1].std() / 0.003 == within
    assert off.std() / math.radians(0.2) == within


def test_bias_follows_the_temperature_after_switch_on() -> None:
    """The rise after one time constant is 1 − 1/e of its end."""
    numbers = {"warm_up_k": 10.0, "warm_up_time_s": 5.0, "accel_temperature_m_s2_k": 0.01}
    sensors = imus(with_sensors(imu=numbers), dt_s=0.01)
    out = rows(sensors, 500)[:, 3:] + [0.0, 0.0, G]
    slope = sensors.records[0]["per_kelvin"][3:]
    assert out[-1] == pytest.approx(slope * 10.0 * (1.0 - math.exp(-1.0)), rel=1e-9)


def test_imu_output_has_its_range_and_its_steps() -> None:
    numbers = {"accel_range_m_s2": 20.0, "accel_resolution_m_s2": 0.5, "gyro_range_deg_s": 90.0}
    sensors = imus(with_sensors(imu=numbers))
    quarter = state_at(velocity=(0.0, 0.0, 1.0), attitude=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))
    sensors.measure(quarter, STILL, WIRES[:1])  # 500 m/s² and 785 rad/s
    out = sensors.records[0]["out"]
    assert out[5] == 20.0
    assert out[2] == pytest.approx(math.radians(90.0))
    level = rows(imus(with_sensors(imu=numbers)), 1)[0]
    assert level[5] == -10.0  # −9.81 in steps of 0.5


# ---------------------------------------------------------------------- random streams


def test_second_imu_has_errors_of_its_own_and_leaves_the_first_one_alone() -> None:
    alone = imus(with_sensors("consumer"))
    pair = imus(with_sensors("consumer", imu={"count": 2.0}))
    first, of_pair = rows(alone, 600), np.empty((600, 2, 6))
    for index in range(600):
        pair.measure(state_at(), STILL, WIRES[:2])
        of_pair[index] = pair.records["out"]
    assert first.tobytes() == of_pair[:, 0].tobytes()
    between = np.corrcoef(of_pair[:, 0, 0], of_pair[:, 1, 0])[0, 1]
    assert abs(between) < 4.0 / math.sqrt(600)


def test_imu_errors_are_those_of_the_seed() -> None:
    vehicle = with_sensors("consumer")
    one, same, other = (rows(imus(vehicle, seed=seed), 50) for seed in (3, 3, 4))
    assert one.tobytes() == same.tobytes()
    assert not np.array_equal(one, other)
