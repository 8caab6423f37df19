"""The compiled plants against SciPy's solution of the same equations, written independently with matrices."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import Vehicle, load_vehicle
from sim_bridge.open_loop import OpenLoop, run_open_loop
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance
from sim_bridge.plant.plant import InitialState

G = 9.81


class Case(NamedTuple):
    initial: InitialState
    speeds: tuple[float, ...]
    disturbance: Disturbance


def rotor_terms(vehicle: Vehicle, speeds: tuple[float, ...]) -> tuple[float, np.ndarray, float]:
    """Thrust, torque and angular momentum of the rotors, by cross products."""
    thrust, torque, momentum = 0.0, np.zeros(3), 0.0
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        pull = rotor.thrust_coefficient_n_s2 * speed * abs(speed)
        thrust += pull
        torque += np.cross(rotor.position_frd_m, [0.0, 0.0, -pull])
        torque[2] -= rotor.spin * rotor.torque_coefficient_n_m_s2 * speed * abs(speed)
        momentum += rotor.spin * rotor.inertia_kg_m2 * speed
    return thrust, torque, momentum


def rigid_slope(vehicle: Vehicle, case: Case):
    thrust, torque, momentum = rotor_terms(vehicle, case.speeds)
    inertia = np.diag(vehicle.inertia_kg_m2)
    wind, _, force, extra, _ = (np.array(value) for value in case.disturbance)
    drag_coefficient = np.array(vehicle.linear_drag_n_s_m)

    def slope(_t: float, x: np.ndarray) -> np.ndarray:
        v, q, w = x[3:6], x[6:10], x[10:13]
        body_to_world = Rotation.from_quat([q[1], q[2], q[3], q[0]]).as_matrix()
        drag = -body_to_world @ (drag_coefficient * (body_to_world.T @ (v - wind)))
        a = [0.0, 0.0, G] + (drag + force - thrust * body_to_world[:, 2]) / vehicle.mass_kg
        dq = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        dw = np.linalg.solve(inertia, torque + extra - np.cross(w, inertia @ w + [0.0, 0.0, momentum]))
        return np.concatenate([v, a, dq, dw])

    return slope


def paper_slope(vehicle: Vehicle, case: Case):
    """Equation 7 as errata.md writes it, with U from the paper's own formulas."""
    w1, w2, w3, w4 = case.speeds
    first = vehicle.rotors[0]
    b, d, jr, arm = (
        first.thrust_coefficient_n_s2,
        first.torque_coefficient_n_m_s2,
        first.inertia_kg_m2,
        first.position_frd_m[0],
    )
    u1, u2, u3 = b * (w1**2 + w2**2 + w3**2 + w4**2), b * (w4**2 - w2**2), b * (w1**2 - w3**2)
    u4 = d * (w2**2 + w4**2 - w1**2 - w3**2)
    wr = w2 + w4 - w1 - w3
    ix, iy, iz = vehicle.inertia_kg_m2
    m = vehicle.mass_kg
    fx, fy, fz = case.disturbance.force_ned_n
    tx, ty, tz = case.disturbance.torque_frd_n_m

    def slope(_t: float, x: np.ndarray) -> np.ndarray:
        f, t, y, p, q, r = x[6:12]
        sf, cf, st, ct, sy, cy = (
            math.sin(f), math.cos(f), math.sin(t), math.cos(t), math.sin(y), math.cos(y),
        )  # fmt: skip
        return np.array([
            *x[3:6],
            (-(cf * st * cy + sf * sy) * u1 + fx) / m,
            (-(cf * st * sy - sf * cy) * u1 + fy) / m,
            G + (-cf * ct * u1 + fz) / m,
            p, q, r,
            (iy - iz) / ix * q * r + jr / ix * q * wr + arm / ix * u2 + tx / ix,
            (iz - ix) / iy * p * r - jr / iy * p * wr + arm / iy * u3 + ty / iy,
            (ix - iy) / iz * p * q + u4 / iz + tz / iz,
        ])  # fmt: skip

    return slope


def random_case(seed: int, vehicle: Vehicle, rates_rad_s: float, plant: str = "rigid") -> Case:
    random = np.random.default_rng(seed)

    def vector(scale: float) -> Vector3:
        return Vector3(*(scale * random.uniform(-1.0, 1.0, 3)))

    hover = math.sqrt(vehicle.weight_n / sum(r.thrust_coefficient_n_s2 for r in vehicle.rotors))
    initial = InitialState(vector(10.0), vector(5.0), vector(1.2), vector(rates_rad_s))
    speeds = tuple(hover * (1.0 + 0.02 * random.uniform(-1.0, 1.0, len(vehicle.rotors))))
    disturbance = Disturbance(vector(6.0), 0.0, vector(0.5), vector(0.005))
    still = disturbance._replace(wind_ned_m_s=Vector3(0.0, 0.0, 0.0))
    return Case(initial, speeds, still if vehicle.wind_refusal(plant) else disturbance)


def flown(vehicle: Vehicle, plant: str, case: Case, seconds: float, dt_s: float) -> np.ndarray:
    state = run_open_loop(
        OpenLoop(vehicle, plant, case.speeds, case.initial, seconds, dt_s, False, False, case.disturbance, 1)
    )
    attitude = state["quaternion"] if plant == "rigid" else state["euler_rad"]
    return np.array([*state["pos_ned_m"], *state["vel_ned_m_s"], *attitude, *state["rates_frd_rad_s"]])


def reference(vehicle: Vehicle, plant: str, case: Case, seconds: float) -> np.ndarray:
    start = case.initial
    roll, pitch, yaw = start.euler_rad
    if plant == "rigid":
        x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
        sign = 1.0 if w >= 0.0 else -1.0
        attitude, slope = [sign * w, sign * x, sign * y, sign * z], rigid_slope(vehicle, case)
    else:
        attitude, slope = [roll, pitch, yaw], paper_slope(vehicle, case)
    x0 = [*start.position_ned_m, *start.velocity_ned_m_s, *attitude, *start.rates_frd_rad_s]
    return solve_ivp(slope, (0.0, seconds), x0, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


PLANTS = [("paper_quad", "rigid"), ("x_quad", "rigid"), ("paper_quad", "paper")]


def vehicle_of(name: str, plant: str) -> Vehicle:
    """Return the vehicle, with drag if it has none and the plant supports it."""
    vehicle = load_vehicle(name)
    return vehicle.with_drag(plant) if (name, plant) == ("paper_quad", "rigid") else vehicle


@pytest.mark.parametrize(("vehicle_name", "plant"), PLANTS)
@pytest.mark.parametrize("seed", range(4))
def test_plant_agrees_with_scipy(vehicle_name: str, plant: str, seed: int) -> None:
    vehicle = vehicle_of(vehicle_name, plant)
    case = random_case(seed, vehicle, 3.0, plant)
    error = np.abs(flown(vehicle, plant, case, 1.0, 1e-3) - reference(vehicle, plant, case, 1.0)).max()
    assert error < 1e-8, f"{error:.2e}"  # measured: at most 1.9e-11


@pytest.mark.parametrize(("vehicle_name", "plant"), PLANTS)
def test_integrator_has_order_four(vehicle_name: str, plant: str) -> None:
    vehicle = vehicle_of(vehicle_name, plant)
    case = random_case(11, vehicle, 6.0, plant)
    exact = reference(vehicle, plant, case, 1.0)
    steps_s = np.array([0.02, 0.01, 0.005, 0.0025])
    errors = np.array([np.abs(flown(vehicle, plant, case, 1.0, dt) - exact).max() for dt in steps_s])
    slope = np.polyfit(np.log(steps_s), np.log(errors), 1)[0]
    assert 3.8 < slope < 4.2, f"slope {slope:.3f} from steps {steps_s} and errors {errors}"


def test_random_cases_exercise_every_term() -> None:
    """Drag, rates and torques are large enough to affect the comparison."""
    vehicle = load_vehicle("x_quad")
    case = random_case(0, vehicle, rates_rad_s=3.0)
    without = case._replace(disturbance=NO_DISTURBANCE)
    difference = np.abs(
        flown(vehicle, "rigid", case, 1.0, 1e-3) - flown(vehicle, "rigid", without, 1.0, 1e-3)
    )
    assert (difference > 1e-4).all()
