"""The multibody plant against the rigid one, conservation laws, closed forms of gyrostats, and the ground."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.params.config import DEFAULT_HOME
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, ActuatorsFrame
from sim_bridge import plants
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.multibody.plant import MultibodyPlant
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.faults.effects import plant_faults
from sim_bridge.plant.faults.schedule import parse_fault
from sim_bridge.plant.layout import DIVERGED
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plants import PLANT_NAMES, make_plant
from sim_bridge.server.hil import hil_state
from sim_bridge.simulator import Simulator
from tests.support.multibody_flights import BOTH_PLANTS, BOTH_VEHICLES, Flight, hover, model_state
from tests.support.tools import NIGHTLY

TOLD = Disturbance(Vector3(2.0, 1.0, -0.5), 0.0, Vector3(0.1, 0.2, 0.3), Vector3(0.01, 0.02, -0.01))


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


def test_a_bad_command_is_counted_and_the_last_good_one_holds() -> None:
    vehicle = load_vehicle("paper_quad")
    flight = Flight("multibody", vehicle, InitialState(Vector3(0.0, 0.0, -9.0)), (hover(vehicle),) * 4)
    flight.fly(0.1)
    flight.command[:4] = (math.nan, math.inf, -math.inf, 1e300)
    flight.fly(0.1)
    assert flight.plant.bad_commands == 4
    assert flight.result == 0
    assert flight.plant.rotor_speeds_rad_s() == pytest.approx([hover(vehicle)] * 4)


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
