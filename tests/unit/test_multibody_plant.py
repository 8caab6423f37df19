"""The multibody plant against the rigid one, conservation laws, closed forms of gyrostats, and the ground."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightstack.core.contract import MAX_ROTORS, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.params.config import DEFAULT_HOME
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge import plants
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.multibody.frames import flip_quaternion, flip_vector
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.multibody.plant import MultibodyPlant
from sim_bridge.plant.contact import FRICTION
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance
from sim_bridge.plant.fault_effects import PlantFaults, RotorFault, plant_faults
from sim_bridge.plant.fault_schedule import parse_fault
from sim_bridge.plant.layout import CONTACT, DIVERGED
from sim_bridge.plant.plant import AT_REST, InitialState, Plant, PlantOptions
from sim_bridge.plants import PLANT_NAMES, make_plant
from sim_bridge.server.hil import hil_state
from sim_bridge.simulator import Simulator
from tests.support.tools import NIGHTLY

BOTH_PLANTS = pytest.mark.parametrize("name", ["rigid", "multibody"])
BOTH_VEHICLES = pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
STOPPED = np.zeros(8)
TOLD = Disturbance(Vector3(2.0, 1.0, -0.5), 0.0, Vector3(0.1, 0.2, 0.3), Vector3(0.01, 0.02, -0.01))


class Flight:
    """A plant in the air, optionally without aerodynamic forces."""

    def __init__(
        self, name: str, vehicle: Vehicle, initial: InitialState = AT_REST, speeds: tuple[float, ...] = (),
        disturbance: Disturbance = NO_DISTURBANCE, step_s: float = 1e-3, thrust: bool = True, ground: bool = False,
    ) -> None:  # fmt: skip
        options = PlantOptions(disturbance, 1, initial, ground, limits=False, battery=None)
        self.plant: Plant = make_plant(vehicle, name, options)
        self.plant.set_step(step_s)
        self.step_s = step_s
        self.command = np.zeros(8)
        if speeds:
            self.plant.set_rotor_speeds(speeds)
            self.command[: len(speeds)] = speeds
        if not thrust:
            self.plant.set_faults(PlantFaults(rotors=[RotorFault(share=0.0)] * MAX_ROTORS))
        self.result = self.plant.show()

    def fly(self, seconds: float) -> Flight:
        self.result = self.plant.advance(self.command, ARMED_FLAG, round(seconds / self.step_s))
        return self

    @property
    def state(self) -> np.ndarray:
        return self.plant.output[0]["state"].copy()


def hover(vehicle: Vehicle) -> float:
    return math.sqrt(vehicle.weight_n / sum(r.thrust_coefficient_n_s2 for r in vehicle.rotors))


class Conditions:
    """A random state with accelerating rotors, wind, a force and a torque."""

    def __init__(self, vehicle: str, seed: int) -> None:
        random = np.random.default_rng(seed)
        loaded = load_vehicle(vehicle)
        self.vehicle = loaded.with_drag("rigid") if vehicle == "paper_quad" else loaded
        place, velocity, euler, rates = random.normal(size=(4, 3)) * [[5.0], [3.0], [0.3], [2.0]]
        self.initial = InitialState(Vector3(*place), Vector3(*velocity), Vector3(*euler), Vector3(*rates))
        speed = hover(self.vehicle)
        self.speeds = tuple((speed * random.uniform(0.6, 1.0, 4)).tolist())
        self.command = speed * (1.0 + 0.03 * random.normal(size=4))

    def end(self, name: str, step_s: float) -> np.ndarray:
        """State after one second."""
        flight = Flight(name, self.vehicle, self.initial, self.speeds, TOLD, step_s)
        flight.command[:4] = self.command
        assert flight.fly(1.0).result == 0
        return flight.state


@BOTH_VEHICLES
@pytest.mark.parametrize("seed", [1, 3] if NIGHTLY else [1])
def test_multibody_converges_to_the_rigid_plant(vehicle: str, seed: int) -> None:
    """Against the rigid plant at 20 µs the error is of fourth order."""
    conditions = Conditions(vehicle, seed)
    truth = conditions.end("rigid", 2e-5)
    steps = (4e-3, 2e-3, 1e-3)
    errors = [np.abs(conditions.end("multibody", step_s) - truth).max() for step_s in steps]
    for step_s, error in zip(steps, errors, strict=True):
        assert error < 1e6 * step_s**4  # measured: 0.0004e6 to 0.62e6
    orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert min(orders) > 3.9  # measured: 3.97
    same_step = np.abs(conditions.end("multibody", 1e-3) - conditions.end("rigid", 1e-3)).max()
    assert same_step < 1e-9  # measured: at most 4e-11; the same equations, implemented twice


def model_state(
    vehicle: Vehicle, state: np.ndarray, speeds: list[float]
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The exported model in this state: independent momentum and energy."""
    model = mujoco.MjModel.from_xml_string(model_xml(vehicle))
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3] = flip_vector(state[:3]), flip_vector(state[3:6])
    data.qpos[3:7], data.qvel[3:6] = flip_quaternion(state[6:10]), flip_vector(state[10:13])
    data.qvel[6:] = speeds
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    mujoco.mj_energyVel(model, data)  # of frame and rotors, to data.energy[1]
    return model, data


class TorqueFree:
    """A tumbling vehicle without aerodynamic forces, its rotors at different speeds."""

    def __init__(self, name: str, step_s: float = 1e-3) -> None:
        # three different moments of inertia, so that the yaw rate changes
        self.vehicle = replace(load_vehicle("paper_quad"), inertia_kg_m2=(7.0e-3, 7.4e-3, 1.1e-2))
        spin = InitialState(Vector3(0.0, 0.0, -50.0), rates_frd_rad_s=Vector3(3.0, -2.0, 4.0))
        speeds = (200.0, 150.0, 220.0, 100.0)
        self.flight = Flight(name, self.vehicle, spin, speeds, step_s=step_s, thrust=False)

    def momentum_and_energy(self) -> tuple[np.ndarray, float]:
        """Inertial angular momentum and rotational energy of frame and rotors by MuJoCo."""
        model, data = model_state(self.vehicle, self.flight.state, self.flight.plant.rotor_speeds_rad_s())
        fall = 0.5 * self.vehicle.mass_kg * float(self.flight.state[3:6] @ self.flight.state[3:6])
        return data.subtree_angmom[model.body("vehicle").id].copy(), float(data.energy[1]) - fall

    def rotor_momenta(self) -> np.ndarray:
        """J_r·Ω relative to the frame about its z axis, clockwise positive, shape (4,)."""
        speeds = self.flight.plant.rotor_speeds_rad_s()
        inertia = [rotor.spin * rotor.inertia_kg_m2 for rotor in self.vehicle.rotors]
        return np.array(inertia) * np.array(speeds)


@BOTH_PLANTS
def test_torque_free_spin_conserves_momentum_and_energy(name: str) -> None:
    """Without air, at constant rotor speeds: the angular momentum in space stays, and so does ½ωᵀIω.

    The drives work Σ s·J_r·Ω·Δr meanwhile: they hold the speeds while the yaw rate r changes.
    """
    free = TorqueFree(name)
    inertia = np.array(free.vehicle.inertia_kg_m2)

    def frame_energy() -> float:
        rates = free.flight.state[10:13]
        return 0.5 * float(rates @ (inertia * rates))

    momentum, energy = free.momentum_and_energy()
    of_frame, yaw_rate = frame_energy(), free.flight.state[12]
    largest_work = 0.0
    for _ in range(10):
        free.flight.fly(0.5)
        now, now_energy = free.momentum_and_energy()
        assert np.abs(now - momentum).max() < 1e-10 * np.linalg.norm(momentum)  # measured: 2.4e-12
        assert frame_energy() == pytest.approx(of_frame, rel=1e-11)  # measured: 6e-14
        work = float(free.rotor_momenta().sum() * (free.flight.state[12] - yaw_rate))
        assert abs(now_energy - energy - work) < 1e-11 * energy  # measured: 4e-14
        largest_work = max(largest_work, abs(work))
    assert largest_work > 1e-4 * energy  # not negligible


@BOTH_PLANTS
def test_spin_up_conserves_momentum_and_takes_energy_from_the_drives(name: str) -> None:
    """While rotors speed up the momentum is constant, and ΔT = Σ ∫ τ·Ω dt with τ = J_r·(Ω̇ + s·ṙ)."""
    free = TorqueFree(name, step_s=1e-4)
    free.flight.command[:4] = (300.0, 100.0, 250.0, 50.0)
    momentum, energy = free.momentum_and_energy()
    spun = [free.rotor_momenta()]
    speeds = [np.array(free.flight.plant.rotor_speeds_rad_s())]
    yaw_rates = [free.flight.state[12]]
    for _ in range(1000):
        free.flight.fly(1e-4)
        spun.append(free.rotor_momenta())
        speeds.append(np.array(free.flight.plant.rotor_speeds_rad_s()))
        yaw_rates.append(free.flight.state[12])
    now, now_energy = free.momentum_and_energy()
    assert np.abs(now - momentum).max() < 1e-8 * np.linalg.norm(momentum)
    # J_r·Ω̇·Ω integrates to ½·J_r·Ω²; J_r·s·Ω·ṙ by the trapezium rule
    of_speed = 0.5 * float(
        (spun[-1] * speeds[-1] - spun[0] * speeds[0]) @ [r.spin for r in free.vehicle.rotors]
    )
    middle = 0.5 * (np.array(spun[1:]) + np.array(spun[:-1]))
    of_yaw = float((middle * np.diff(yaw_rates)[:, None]).sum())
    assert abs(of_yaw) > 0.01 * abs(of_speed)  # neither is negligible
    assert now_energy - energy == pytest.approx(of_speed + of_yaw, rel=1e-8)  # measured: 4e-10


def test_kinetic_energy_grows_by_the_work_of_the_drives() -> None:
    """The work is the integral of MuJoCo's hinge torques times speeds by Simpson's rule."""
    free = TorqueFree("multibody", step_s=1e-4)
    free.flight.command[:4] = (300.0, 100.0, 250.0, 50.0)
    plant = free.flight.plant
    assert isinstance(plant, MultibodyPlant)
    _, energy = free.momentum_and_energy()
    power = []
    for tick in range(1001):
        if tick:
            free.flight.fly(1e-4)
        else:  # zero steps store the commands
            plant.advance(free.flight.command, ARMED_FLAG, 0)
        plant.acceleration_ned_m_s2()
        power.append(float(plant.data.qfrc_applied[6:] @ plant.data.qvel[6:]))
    _, now_energy = free.momentum_and_energy()
    weights = np.array([1.0, *[4.0, 2.0] * 499, 4.0, 1.0])
    work = 1e-4 / 3.0 * float(weights @ power)
    assert now_energy - energy == pytest.approx(work, rel=1e-7)  # measured: 4e-9


def gyrostat(rates: Vector3, torque: Vector3 = Vector3(0.0, 0.0, 0.0)) -> tuple[Flight, float]:  # noqa: B008
    """The paper's vehicle with only its clockwise rotors turning, and the rate h/I at which its axis goes round."""
    vehicle = load_vehicle("paper_quad")
    speeds = (220.0, 0.0, 220.0, 0.0)
    start = InitialState(Vector3(0.0, 0.0, -50.0), rates_frd_rad_s=rates)
    flight = Flight(
        "multibody", vehicle, start, speeds, Disturbance(torque_frd_n_m=torque), thrust=False, step_s=1e-3
    )
    momentum = 2.0 * 220.0 * vehicle.rotors[0].inertia_kg_m2
    return flight, momentum / vehicle.inertia_kg_m2[0]


def test_free_precession_of_a_gyrostat() -> None:
    """I ṗ = −h q, I q̇ = h p: the rate turns in the body with h/I."""
    flight, rate = gyrostat(Vector3(0.5, 0.0, 0.0))
    crossings, last = [], 0.0
    for tick in range(1, 12001):
        q = float(flight.fly(1e-3).state[11])
        if last < 0.0 <= q:
            crossings.append(1e-3 * (tick - q / (q - last)))
        last = q
    periods = np.diff(crossings)
    assert len(periods) >= 5
    assert 2.0 * math.pi / periods.mean() == pytest.approx(rate, rel=1e-5)  # required: 1 %
    assert np.hypot(*flight.state[10:12]) == pytest.approx(0.5, rel=1e-9)


def test_constant_torque_makes_a_gyrostat_precess_and_nutate() -> None:
    """I ṗ = τ − h q, I q̇ = h p from rest: p = τ/h·sin(h t/I), q = τ/h·(1 − cos(h t/I))."""
    torque = 1e-3
    flight, rate = gyrostat(Vector3(0.0, 0.0, 0.0), Vector3(torque, 0.0, 0.0))
    amplitude = torque / (rate * load_vehicle("paper_quad").inertia_kg_m2[0])
    mean = 0.0
    for tick in range(1, 4001):
        p, q = flight.fly(1e-3).state[10:12]
        angle = rate * tick * 1e-3
        assert abs(p - amplitude * math.sin(angle)) < 1e-5 * amplitude
        assert abs(q - amplitude * (1.0 - math.cos(angle))) < 1e-5 * amplitude
        mean += q
    turns = rate * 4.0 / (2.0 * math.pi)
    assert turns > 2.0
    assert mean / 4000 == pytest.approx(amplitude, rel=0.1)  # the precession of the textbooks, τ/h


def test_hinge_accelerations_are_those_of_the_lag() -> None:
    """MuJoCo's own accelerations of the hinges, from the drive torques, in a random state."""
    conditions = Conditions("paper_quad", 4)
    flight = Flight("multibody", conditions.vehicle, conditions.initial, conditions.speeds, TOLD)
    flight.command[:4] = 1.3 * np.array(conditions.speeds)
    flight.fly(1e-3)
    assert isinstance(flight.plant, MultibodyPlant)
    flight.plant.acceleration_ned_m_s2()
    wanted = (flight.command[:4] - flight.plant.rotor_speeds_rad_s()) / conditions.vehicle.rotors[0].lag_s
    assert wanted.min() > 1e3
    assert np.allclose(flight.plant.data.qacc[6:], wanted, rtol=1e-10)


def test_spin_up_turns_the_vehicle_the_other_way() -> None:
    """Σ J_r·ΔΩ of the clockwise rotors is transferred to the frame, and I_z includes the rotors."""
    vehicle = load_vehicle("paper_quad")
    flight = Flight("multibody", vehicle, InitialState(Vector3(0.0, 0.0, -9.0)), (100.0,) * 4, thrust=False)
    flight.command[:4] = (200.0, 100.0, 200.0, 100.0)
    yaw_rate = flight.fly(0.2).state[12]
    expected = -2.0 * vehicle.rotors[0].inertia_kg_m2 * 100.0 / vehicle.inertia_kg_m2[2]
    assert yaw_rate == pytest.approx(expected, rel=1e-5)


@BOTH_VEHICLES
@pytest.mark.parametrize("step_s", [0.01, 0.002, 1e-3])
def test_rests_at_the_origin(vehicle: str, step_s: float) -> None:
    flight = Flight("multibody", load_vehicle(vehicle), step_s=step_s, ground=True)
    assert flight.result == CONTACT
    flight.plant.advance(STOPPED, 0, min(2000, round(5.0 / step_s)))
    assert np.abs(flight.state - [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]).max() < 1e-12  # measured: 6e-14
    assert flight.plant.penetration_m() < 1e-12


@BOTH_VEHICLES
def test_touchdown_has_a_small_bounce(vehicle: str) -> None:
    start = InitialState(Vector3(0.0, 0.0, -0.02), Vector3(0.1, 0.0, 1.0))
    flight = Flight("multibody", load_vehicle(vehicle), start, ground=True)
    heights = []
    for _ in range(1000):
        flight.result = flight.plant.advance(STOPPED, 0, 1)
        heights.append(-flight.state[2])
    first = int(np.argmax(np.array(heights) < 0.0))
    assert max(heights[first:]) < 0.002  # measured: 0.9 mm, as with the rigid plant
    assert min(heights) > -0.006  # measured: 3.5 mm
    assert flight.result == CONTACT
    assert np.abs(flight.state[[2, 3, 4, 5]]).max() < 1e-6


@BOTH_VEHICLES
@pytest.mark.parametrize("sink_m_s", [2.0, 10.0, 30.0])
def test_hard_landing_stays_finite_and_above_ground(vehicle: str, sink_m_s: float) -> None:
    start = InitialState(
        Vector3(0.0, 0.0, -1.0), Vector3(2.0, 1.0, sink_m_s), Vector3(0.4, -0.3, 1.0), Vector3(3.0, -2.0, 1.0)
    )
    flight = Flight("multibody", load_vehicle(vehicle), start, ground=True)
    for _ in range(160):
        result = flight.plant.advance(STOPPED, 0, 50)
        assert np.isfinite(flight.state).all()
        assert np.linalg.norm(flight.state[3:6]) < math.hypot(sink_m_s, 5.0) + 5.0
    assert result == CONTACT
    assert np.abs(flight.state[3:6]).max() < 1e-3
    assert flight.state[2] < 0.25  # within legs and arms


@pytest.mark.parametrize("euler_deg", [(180.0, 0.0, 0.0), (140.0, 20.0, 0.0)])
def test_tumbled_vehicle_lies_still(euler_deg: tuple[float, ...]) -> None:
    start = InitialState(Vector3(0.0, 0.0, -1.0), euler_rad=Vector3(*np.radians(euler_deg)))
    flight = Flight("multibody", load_vehicle("paper_quad"), start, ground=True)
    flight.plant.advance(STOPPED, 0, 9000)
    before = flight.state
    assert flight.plant.advance(STOPPED, 0, 1000) == CONTACT
    assert np.abs(flight.state - before)[:6].max() < 1e-6


@BOTH_VEHICLES
def test_friction_holds_below_its_limit_and_slides_above(vehicle: str) -> None:
    weight = load_vehicle(vehicle).weight_n

    def pushed(share: float) -> Flight:
        push = Disturbance(force_ned_n=Vector3(share * weight, 0.0, 0.0))
        flight = Flight("multibody", load_vehicle(vehicle), disturbance=push, ground=True)
        flight.plant.advance(STOPPED, 0, 1500)
        return flight

    held = pushed(0.3)
    before = held.state
    assert 0.0 < before[0] < 1e-3
    held.plant.advance(STOPPED, 0, 2000)
    assert np.abs(held.state - before)[:2].max() < 1e-6  # measured: 2e-8
    assert pushed(FRICTION + 0.05).state[3] > 0.3


@BOTH_VEHICLES
def test_takes_off_when_thrust_exceeds_weight(vehicle: str) -> None:
    flight = Flight("multibody", load_vehicle(vehicle), ground=True)
    flight.command[:4] = 0.95 * hover(load_vehicle(vehicle))
    assert flight.fly(2.0).result == CONTACT
    flight.command[:4] = 1.1 * hover(load_vehicle(vehicle))
    assert flight.fly(1.0).result == 0
    assert flight.state[2] < -0.3
    assert np.abs(flight.state[[0, 1, 7, 8, 9]]).max() < 1e-9


def test_a_bad_command_is_counted_and_the_last_good_one_holds() -> None:
    vehicle = load_vehicle("paper_quad")
    flight = Flight("multibody", vehicle, InitialState(Vector3(0.0, 0.0, -9.0)), (hover(vehicle),) * 4)
    flight.fly(0.1)
    flight.command[:4] = (math.nan, math.inf, -math.inf, 1e300)
    flight.fly(0.1)
    assert flight.plant.bad_commands == 4
    assert flight.result == 0
    assert flight.plant.rotor_speeds_rad_s() == pytest.approx([hover(vehicle)] * 4)


def test_ideal_rotors_are_at_their_speeds_at_once() -> None:
    vehicle = load_vehicle("paper_quad").with_ideal_rotors()
    flight = Flight("multibody", vehicle, InitialState(Vector3(0.0, 0.0, -9.0)))
    flight.command[:4] = (100.0, 200.0, 300.0, 400.0)
    flight.fly(1e-3)
    assert flight.plant.rotor_speeds_rad_s() == [100.0, 200.0, 300.0, 400.0]
    flight.plant.set_rotor_speeds((50.0,) * 4)  # not the commanded speeds
    assert flight.plant.acceleration_ned_m_s2().z == pytest.approx(
        9.81 - 4.0 * 2500.0 * 2.93e-5 / 0.55, rel=1e-3
    )  # the frame is tilted a little


@BOTH_PLANTS
@pytest.mark.parametrize("lag_s", [0.0, 0.005])
def test_rotors_without_lag_have_no_spin_up_torque(name: str, lag_s: float) -> None:
    """A convention: without lag the speeds are imposed, without the reaction Σ s·J_r·ΔΩ on the frame.

    The reaction to a jump of the speed would be an impulse of a motor of infinite torque in every tick, and no yaw
    loop is stable with it. So momentum is not conserved, by exactly that sum; with a lag, however short, it is.
    """
    paper = load_vehicle("paper_quad")
    vehicle = replace(paper, rotors=tuple(replace(rotor, lag_s=lag_s) for rotor in paper.rotors))
    flight = Flight(name, vehicle, InitialState(Vector3(0.0, 0.0, -9.0)), (100.0,) * 4, thrust=False)

    def momentum() -> float:
        model, data = model_state(vehicle, flight.state, flight.plant.rotor_speeds_rad_s())
        return -float(data.subtree_angmom[model.body("vehicle").id][2])  # about down

    before = momentum()
    flight.command[:4] = (200.0, 100.0, 200.0, 100.0)
    flight.fly(0.2)
    gained = sum(
        rotor.spin * rotor.inertia_kg_m2 * (speed - 100.0)
        for rotor, speed in zip(vehicle.rotors, flight.command[:4].tolist(), strict=True)
    )
    assert gained == pytest.approx(2.0 * 6.3e-5 * 100.0)
    if lag_s:
        assert abs(momentum() - before) < 1e-6 * gained
    else:
        assert abs(flight.state[12]) < 1e-30
        assert momentum() - before == pytest.approx(gained, rel=1e-9)


LARGEST_TORQUE = 0.2  # N m; a hover takes 0.033


def with_weak_drives() -> Vehicle:
    paper = load_vehicle("paper_quad")
    rotors = tuple(replace(rotor, max_drive_torque_n_m=LARGEST_TORQUE) for rotor in paper.rotors)
    return replace(paper, rotors=rotors)


@BOTH_PLANTS
def test_limited_drive_follows_its_equation(name: str) -> None:
    """J·Ω̇ of the lag, limited so that its sum with the drag is within the torque, against SciPy."""
    vehicle = with_weak_drives()
    rotor = vehicle.rotors[0]
    inertia, drag, lag = rotor.inertia_kg_m2, rotor.torque_coefficient_n_m_s2, rotor.lag_s
    start, commands = np.full(4, 200.0), np.array([330.0, 205.0, 60.0, 120.0])

    def slope(_: float, speed: np.ndarray) -> np.ndarray:
        torque = inertia * (commands - speed) / lag + drag * speed * np.abs(speed)
        clipped: np.ndarray = (
            np.clip(torque, -LARGEST_TORQUE, LARGEST_TORQUE) - drag * speed * np.abs(speed)
        ) / inertia
        return clipped

    flight = Flight(name, vehicle, InitialState(Vector3(0.0, 0.0, -50.0)), tuple(start.tolist()))
    flight.command[:4] = commands
    times = np.arange(1, 301) * 1e-3
    truth = solve_ivp(slope, (0.0, 0.3), start, t_eval=times, max_step=1e-4, rtol=1e-10, atol=1e-8).y.T
    speeds = []
    for _ in times:
        flight.fly(1e-3)
        speeds.append(flight.plant.rotor_speeds_rad_s())
    assert np.abs(np.array(speeds) - truth).max() < 0.05  # of 200 rad/s; measured: 0.011
    assert speeds[-1] == pytest.approx(commands, abs=0.05)
    unlimited = 330.0 - 130.0 * math.exp(-4.0)
    assert speeds[19][0] < unlimited - 50.0  # an unlimited drive is nearly there after four lags


def test_limited_drives_agree_on_both_plants_and_conserve_momentum() -> None:
    ends = []
    for name in ("rigid", "multibody"):
        spin = InitialState(Vector3(0.0, 0.0, -50.0), rates_frd_rad_s=Vector3(1.0, -2.0, 0.5))
        flight = Flight(name, with_weak_drives(), spin, (200.0,) * 4, thrust=False)
        flight.command[:4] = (330.0, 205.0, 60.0, 120.0)

        def momentum(flight: Flight = flight) -> np.ndarray:
            speeds = flight.plant.rotor_speeds_rad_s()
            model, data = model_state(load_vehicle("paper_quad"), flight.state, speeds)
            return data.subtree_angmom[model.body("vehicle").id].copy()

        before = momentum()
        flight.fly(0.3)
        assert np.abs(momentum() - before).max() < 1e-4 * np.linalg.norm(
            before
        )  # measured: 8e-6, where a limit begins or ends within a step
        ends.append(flight.state)
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


def test_divergence_ends_the_flight_with_one_sentence() -> None:
    push = PlantOptions(Disturbance(torque_frd_n_m=Vector3(1e6, 0.0, 0.0)), ground=False)
    simulator = Simulator(load_vehicle("paper_quad"), "multibody", push)
    actuators = ActuatorsFrame()
    with pytest.raises(PlantDivergedError, match="diverged at t="):  # noqa: PT012  # in one of the ticks
        for _ in range(1000):
            simulator.apply(actuators)
    assert simulator.plant.show() & DIVERGED
    assert np.isfinite(np.array(simulator.plant.acceleration_ned_m_s2())).all()


def test_faults_battery_and_gusts_act_as_on_the_rigid_plant() -> None:
    vehicle = load_vehicle("x_quad")
    gusty = Disturbance(Vector3(3.0, 1.0, 0.0), 1.5, torque_gust_n_m=0.01)
    start = InitialState(Vector3(0.0, 0.0, -50.0))
    ends = []
    for name in ("rigid", "multibody"):
        plant = make_plant(vehicle, name, PlantOptions(gusty, 5, start))
        command = np.full(8, hover(vehicle))
        plant.advance(command, ARMED_FLAG, 1100)
        plant.set_faults(plant_faults([parse_fault("rotor:1:weak=0.7", 4)]))
        plant.advance(command, ARMED_FLAG, 50)
        plant.set_faults(plant_faults([parse_fault("rotor:3:stuck=300", 4)]))
        plant.advance(command, ARMED_FLAG, 50)
        plant.set_charge(0.0)
        plant.advance(command, ARMED_FLAG, 50)
        assert plant.battery is not None
        ends.append(np.array([*plant.output[0]["state"], *plant.rotor_speeds_rad_s(), *plant.battery]))
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert max(ends[0][13:17]) < 60.0  # without power all rotors run down


def test_acceleration_and_airspeed_are_those_of_the_rigid_plant() -> None:
    conditions = Conditions("x_quad", 5)
    both = [
        Flight(name, conditions.vehicle, conditions.initial, conditions.speeds, TOLD)
        for name in ("rigid", "multibody")
    ]
    rigid, multibody = (flight.plant for flight in both)
    assert multibody.acceleration_ned_m_s2() == pytest.approx(rigid.acceleration_ned_m_s2(), rel=1e-12)
    assert multibody.airspeed_m_s() == pytest.approx(rigid.airspeed_m_s(), rel=1e-15)
    assert multibody.euler_rad() is None
    assert "parts meet the vehicle file" in (multibody.description() or "")


@pytest.mark.parametrize("name", PLANT_NAMES)
def test_hil_messages_do_not_change_the_flight(name: str) -> None:
    """HIL_STATE_QUATERNION evaluates the acceleration in each step without a change of any byte of the flight."""

    def flight(hil: bool) -> list[bytes]:
        vehicle = load_vehicle("paper_quad")
        start = InitialState(Vector3(0.0, 0.0, -0.02), Vector3(0.3, 0.1, 0.5), Vector3(0.1, 0.05, 0.3))
        simulator, frame = Simulator(vehicle, name, PlantOptions(initial=start)), LocalFrame(DEFAULT_HOME)
        actuators, states, touched = ActuatorsFrame(), [], 0
        actuators.set_rotor_count(4)
        for tick in range(800):
            actuators.rotor_speed_rad_s[:4] = (0.5 if tick < 400 else 1.1) * hover(vehicle)
            actuators.seal(tick, ARMED_FLAG)
            simulator.apply(actuators)
            if hil:
                hil_state(simulator, frame)
            touched += simulator.on_ground
            states.append(bytes(simulator.state_frame()))
        assert touched > 100
        assert not simulator.on_ground
        return states

    assert flight(hil=True) == flight(hil=False)


@pytest.fixture
def no_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sim_bridge.multibody.plant", None)


@pytest.mark.usefixtures("no_mujoco")
def test_error_names_the_missing_extra() -> None:
    with pytest.raises(UsageProblemError, match=r"needs MuJoCo: pip install mujoco pillow imageio-ffmpeg$"):
        plants.make_plant(load_vehicle("paper_quad"), "multibody", PlantOptions())
