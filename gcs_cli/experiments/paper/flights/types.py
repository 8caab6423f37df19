"""Data types of the experiments: a case, its recording, and the figures of an axis."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray, Vector3

IntArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

NOTHING = Vector3(0.0, 0.0, 0.0)


class Case(NamedTuple):
    """One closed-loop experiment; hashable; its key names it in results.json."""

    key: str
    trajectory: str
    """Name of a file in ``gcs_cli/experiments/paper/trajectories``, without .toml."""
    controller: str = "pid"
    """Or "backstepping"."""
    gains: str = "paper"
    """A gains file: paper, paper_rate_fed, tuned, backstepping_poles."""
    plant: str = "paper"
    """paper (small angles), rigid, multibody."""
    limits: bool = True
    """Rotor speeds are limited, in the plant and in the mixer; else thrust is unlimited and signed."""
    inner_hz: int = 1000
    outer_hz: int = 250
    lag_s: float | None = None
    """Time constant of all motors; None: the vehicle file's."""
    force_ned_n: Vector3 = NOTHING
    torque_frd_n_m: Vector3 = NOTHING
    mass_factor: float = 1.0
    """Of the plant only: the controller keeps Table I."""
    inertia_factor: float = 1.0
    """Of the plant only, as the mass."""
    delay_steps: int = 0
    """Further inner steps between a state and the actuators that answer it."""
    scale: float = 1.0
    """Of all displacements of the trajectory."""
    drive_torque_n_m: float | None = None
    """Largest motor torque on the rigid and the multibody plant; None: the vehicle file's."""
    shaped: bool = False
    """Setpoints pass a reference model with velocity and acceleration feedforward, as in guidance."""
    vehicle: str = "paper_quad"


class Recording(NamedTuple):
    """The flight of a case: one row for each of n inner ticks, up to its end or a crash."""

    case: Case
    time_s: FloatArray
    """Shape (n,)."""
    reference: FloatArray
    """Shape (n, 4): north, east, down [m], yaw [rad]; NaN for a position that the trajectory does not control."""
    position_ned_m: FloatArray
    """Shape (n, 3)."""
    velocity_ned_m_s: FloatArray
    """Shape (n, 3)."""
    euler_rad: FloatArray
    """Shape (n, 3): roll, pitch, yaw; yaw without jumps."""
    euler_target_rad: FloatArray
    """Shape (n, 3): target of the outer loop."""
    rates_frd_rad_s: FloatArray
    """Shape (n, 3)."""
    wrench: FloatArray
    """Shape (n, 4), demanded: thrust [N] and torque FRD [N m]."""
    wrench_achieved: FloatArray
    """Shape (n, 4): wrench achieved by the mixer."""
    rotor_speed_rad_s: FloatArray
    """Shape (n, rotors): true speeds."""
    status: IntArray
    """Shape (n,): bits of ``LoopStatus``."""
    ended_s: float | None
    """Time of the crash or the loss of control; None: complete."""
    ended_why: str
    ended_how: str = ""
    """"crashed" or "lost" (control); empty: complete."""


class MoveMetrics(NamedTuple):
    """One move of an axis and its overshoot."""

    at_s: float
    watched_s: float
    """Until the next move begins, or the flight ends."""
    by: float
    """Metres or radians."""
    overshoot_percent: float | None
    """None if the axis was not at rest when the move began."""


class AxisMetrics(NamedTuple):
    """Figures of one axis against its reference; None where one is not defined.

    Lengths in metres, angles in radians; overshoot in per cent of the step.
    """

    overshoot_percent: float | None
    """The largest of all moves that began at rest."""
    rise_time_s: float | None
    settling_time_s: float | None
    steady_state_error: float
    rms_error: float
    max_error: float
    overshoot_median_percent: float | None = None
    moves: tuple[MoveMetrics, ...] = ()
