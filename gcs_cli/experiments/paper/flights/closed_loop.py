"""Fly one case: plant and control loops in this process, exchanged as in lockstep, without links.

Only this module of the ground station joins the two (docs/explanation/decisions.md): the experiments are hundreds of
flights, too many to start three processes for each. The loops are the flight stack's, the plants the simulator's. A
tick is that of the lockstep: state to the loops, rotor commands back, held for one period. A test holds a case equal,
bit for bit, to the same flight through the links.

The vehicle starts in hover, and there is no ground: the paper has none.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flightstack.control.controller_loading import load_controller
from flightstack.control.loops import PythonLoops
from flightstack.core.contract import ATTITUDE_TARGET_SIZE, MAX_ROTORS, FloatArray, LoopRow
from flightstack.core.geometry import quaternion_from_euler
from flightstack.core.geometry_bulk import euler_from_quaternions
from flightstack.params.behaviour import Behaviour
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import Vehicle, load_vehicle
from gcs_cli.experiments.paper.flights.endings import ending
from gcs_cli.experiments.paper.flights.trajectory import (
    ATTITUDE,
    Trajectory,
    load_trajectory,
    sample,
    setpoints,
    shaped_setpoints,
)
from gcs_cli.experiments.paper.flights.types import Case, Recording
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.layout import DIVERGED, OUTPUT
from sim_bridge.plant.plant import Plant, PlantOptions
from sim_bridge.simulator import Simulator

PHYSICS_HZ = 1000.0
"""A plant's step is at most its inverse, as in the simulator."""
_ARMED = 2  # FS_ACTUATORS


class Rows(NamedTuple):
    """Exchanges of plant and loops over n inner ticks; row k of ``loops`` belongs to row k of ``targets``."""

    loops: FloatArray
    """Shape (n, 48): rows of the inner loop."""
    targets: FloatArray
    """Shape (n, 5): the attitude target in each tick, array form of ``AttitudeTarget``."""
    diverged: bool
    """The plant diverged in the last tick."""


def controlled_vehicle(case: Case) -> Vehicle:
    """Return the vehicle model of the loops: Table I, with or without limits of the rotor speeds."""
    vehicle = load_vehicle(case.vehicle)
    return vehicle if case.limits else vehicle.with_ideal_rotors()


def flown_vehicle(case: Case) -> Vehicle:
    """Return the vehicle model of the plant, with the case's mass, inertia, motor lag and motor torque."""
    vehicle = load_vehicle(case.vehicle)
    ix, iy, iz = (case.inertia_factor * value for value in vehicle.inertia_kg_m2)
    rotors = vehicle.rotors
    if case.lag_s is not None:
        rotors = tuple(replace(rotor, lag_s=case.lag_s) for rotor in rotors)
    if case.drive_torque_n_m is not None:
        rotors = tuple(replace(rotor, max_drive_torque_n_m=case.drive_torque_n_m) for rotor in rotors)
    return replace(
        vehicle, mass_kg=case.mass_factor * vehicle.mass_kg, inertia_kg_m2=(ix, iy, iz), rotors=rotors
    )


def make_loops(case: Case, outer_hz: float | None = None) -> PythonLoops:
    """Return the loops of the case as the flight stack creates them; ``outer_hz`` replaces the case's rate.

    Raise ConfigError.
    """
    return PythonLoops(
        controlled_vehicle(case),
        load_controller(case.controller),
        open_gains(case.gains),
        case.inner_hz,
        case.outer_hz if outer_hz is None else outer_hz,
        math.radians(Behaviour().max_tilt_deg),
    )


def make_plant(case: Case) -> tuple[Plant, int]:
    """Return the plant in hover, and its number of steps in an inner period."""
    options = PlantOptions(
        disturbance=Disturbance(force_ned_n=case.force_ned_n, torque_frd_n_m=case.torque_frd_n_m),
        ground=False,
        limits=case.limits,
        battery=None,
    )
    plant = Simulator(flown_vehicle(case), case.plant, options).plant
    steps = max(1, math.ceil(PHYSICS_HZ / case.inner_hz - 1e-9))
    plant.set_step(1.0 / case.inner_hz / steps)
    plant.set_rotor_speeds(hover_speeds(case))
    plant.output = np.zeros(1, OUTPUT)
    plant.show()
    return plant, steps


def hover_speeds(case: Case) -> tuple[float, ...]:
    """Return the rotor speeds [rad/s] of Table I's vehicle in hover."""
    return tuple(map(math.sqrt, load_vehicle(case.vehicle).hover_speeds_squared()))


def fly(case: Case) -> Recording:
    """Fly the case and return its recording, the same bits for the same case; raise ConfigError.

    A crash or a loss of control ends the recording and is no error: see ``ended_s`` and ``ended_why``.
    """
    trajectory = load_trajectory(case.trajectory)
    return _recording(case, trajectory, fly_rows(case, trajectory))


class Exchange:
    """Plant and loops of a case, which exchange states and rotor commands tick by tick as in lockstep."""

    def __init__(self, case: Case, outer_hz: float | None = None) -> None:
        """Bring both to hover; raise ConfigError. ``outer_hz``: see ``make_loops``."""
        self.loops, (self._plant, self._steps) = make_loops(case, outer_hz), make_plant(case)
        self.state: FloatArray = self._plant.output[0]["state"]
        """Array form of ``VehicleState``, shape (13,); a view that every tick changes."""
        self._speeds: FloatArray = self._plant.output[0]["rotor_speed"]
        self._waiting = [_padded(hover_speeds(case)) for _ in range(case.delay_steps)]
        self.loops.reset(self.state)

    def tick(
        self,
        demand: FloatArray,
        outer_due: bool,
        attitude_only: bool,
        row: FloatArray,
        instead: FloatArray | None = None,
    ) -> bool:
        """Run one inner tick, fill ``row``, shape (48,), and return True if the plant diverged.

        ``demand`` is a setpoint (11,), or an attitude target (5,) for the inner loop alone, set when ``outer_due``.
        ``instead`` replaces the rotor commands that are due.
        """
        if attitude_only and outer_due:
            self.loops.set_attitude_target(demand)
        self.loops.step(self.state, demand, self._speeds, outer_due and not attitude_only, row)
        self._waiting.append(row[LoopRow.ROTOR_COMMAND].copy())
        due = self._waiting.pop(0)
        return bool(self._plant.advance(due if instead is None else instead, _ARMED, self._steps) & DIVERGED)


def fly_rows(case: Case, trajectory: Trajectory) -> Rows:
    """Fly the case to the trajectory's end, or until the plant diverges; raise ConfigError."""
    exchange, divisor = Exchange(case), _divisor(case)
    count = round(trajectory.duration_s * case.inner_hz)
    wanted = _wanted(case, trajectory, np.arange(0, count, divisor) / case.inner_hz)
    attitude_only = trajectory.kind == ATTITUDE
    rows, targets = np.zeros((count, LoopRow.SIZE)), np.zeros((count, ATTITUDE_TARGET_SIZE))
    for tick in range(count):
        diverged = exchange.tick(wanted[tick // divisor], tick % divisor == 0, attitude_only, rows[tick])
        targets[tick] = exchange.loops.attitude_target
        if diverged:
            return Rows(rows[: tick + 1], targets[: tick + 1], True)
    return Rows(rows, targets, False)


def _divisor(case: Case) -> int:
    if case.inner_hz % case.outer_hz:
        raise ValueError(
            f"an outer rate of {case.outer_hz} Hz does not divide the inner rate {case.inner_hz}"
        )
    return case.inner_hz // case.outer_hz


def _padded(speeds: tuple[float, ...]) -> FloatArray:
    command = np.zeros(MAX_ROTORS)
    command[: len(speeds)] = speeds
    return command


def _wanted(case: Case, trajectory: Trajectory, time_s: FloatArray) -> FloatArray:
    """Return the input of the loops at each outer tick: setpoints (n, 11), or attitude targets (n, 5)."""
    if trajectory.kind != ATTITUDE:
        shape = shaped_setpoints if case.shaped else setpoints
        return shape(trajectory, time_s, case.scale)
    weight_n = load_vehicle(case.vehicle).weight_n
    rows = np.zeros((len(time_s), ATTITUDE_TARGET_SIZE))
    for row, (roll, pitch, yaw) in zip(
        rows, sample(trajectory, time_s, case.scale).value.tolist(), strict=True
    ):
        row[:4] = quaternion_from_euler(roll, pitch, yaw)
        row[4] = weight_n / (math.cos(roll) * math.cos(pitch))
    return rows


def _recording(case: Case, trajectory: Trajectory, rows: Rows) -> Recording:
    flown = rows.loops
    time_s = np.arange(len(flown)) / case.inner_hz
    reference = _reference(case, trajectory, time_s)
    end = ending(flown[:, LoopRow.STATE], reference, rows.diverged, case.inner_hz)
    count = end.ticks
    state = flown[:count, LoopRow.STATE]
    rotors = len(load_vehicle(case.vehicle).rotors)
    speed_at = LoopRow.ROTOR_SPEED.start
    return Recording(
        case,
        time_s[:count],
        reference[:count],
        state[:, 0:3],
        state[:, 3:6],
        _euler(state[:, 6:10]),
        _euler(rows.targets[:count, :4]),
        state[:, 10:13],
        flown[:count, LoopRow.WRENCH],
        flown[:count, LoopRow.WRENCH_ACHIEVED],
        flown[:count, speed_at : speed_at + rotors],
        flown[:count, LoopRow.STATUS].astype(np.int64),
        None if not end.how else count / case.inner_hz,
        end.why,
        end.how,
    )


def _reference(case: Case, trajectory: Trajectory, time_s: FloatArray) -> FloatArray:
    """Reference at the inner ticks, shape (n, 4); position is NaN where the trajectory does not steer it."""
    value = sample(trajectory, time_s, case.scale).value
    if trajectory.kind != ATTITUDE:
        return value
    reference = np.full((len(time_s), 4), math.nan)
    reference[:, 3] = value[:, 2]
    return reference


def _euler(quaternions: FloatArray) -> FloatArray:
    euler = euler_from_quaternions(quaternions)
    euler[:, 2] = np.unwrap(euler[:, 2])
    return euler
