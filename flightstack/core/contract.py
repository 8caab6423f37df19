"""Types shared by all packages of the flight stack and by the C port (``fs_types.h``).

World frame NED, body frame FRD, quaternions Hamilton, scalar first, body to world. SI units, radians.

Each type has an array form, its fields in order as float64, in which Python, kernels and the C backends exchange it
(``flightstack.core.arrays``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

if TYPE_CHECKING:
    import numpy as np  # takes 0.1 s, and a command that only talks to a vehicle has no arrays

FloatArray: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"
SingleArray: TypeAlias = "np.ndarray[Any, np.dtype[np.float32]]"
ByteArray: TypeAlias = "np.ndarray[Any, np.dtype[np.uint8]]"
RecordArray: TypeAlias = "np.ndarray[Any, np.dtype[np.void]]"
Record: TypeAlias = Any
"""One element of a ``RecordArray``, indexed by the names of its fields."""

MAX_ROTORS = 8
STATE_SIZE = 13
SETPOINT_SIZE = 11
ATTITUDE_TARGET_SIZE = 5


class LoopRow:
    """Columns of the row that the inner loop writes each tick: its inputs, the output of each stage, and a status.

    Logs, processor-in-the-loop checks and tests read this row.
    """

    STATE = slice(0, 13)
    REFERENCE_ATTITUDE = slice(13, 17)
    REFERENCE_RATES = slice(17, 20)
    REFERENCE_ACCELERATION = slice(20, 23)
    WRENCH = slice(23, 27)
    WRENCH_ACHIEVED = slice(27, 31)
    ROTOR_COMMAND = slice(31, 31 + MAX_ROTORS)
    ROTOR_SPEED = slice(39, 39 + MAX_ROTORS)
    STATUS = 47
    SIZE = 48


class LoopStatus:
    """Bits of the status column."""

    INPUT_NOT_FINITE = 1
    ROLL_SATURATED = 2
    PITCH_SATURATED = 4
    YAW_SATURATED = 8
    THRUST_SATURATED = 16
    IDLE = 32
    OUTPUT_NOT_FINITE = 64
    INPUT_STALE = 128


class LoopFlags:
    """Bits that control one tick of the loops; sent in FS_PIL_STEP and logged."""

    OUTER_DUE = 1
    """The outer loop runs on the setpoint."""
    SET_TARGET = 2
    """Guidance provides the attitude target instead of the outer loop."""
    RESET = 4
    """The loops reset their memory at the start of a flight."""


class Vector3(NamedTuple):
    """A vector; the name of the variable states frame and unit."""

    x: float
    y: float
    z: float


class Quaternion(NamedTuple):
    """A unit quaternion, Hamilton convention, body FRD to world NED."""

    w: float
    x: float
    y: float
    z: float


class VehicleState(NamedTuple):
    """Rigid-body state of the vehicle at one instant."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    attitude: Quaternion
    rates_frd_rad_s: Vector3


class PositionSetpoint(NamedTuple):
    """Input of the outer loop: a point of a trajectory and the heading."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    acceleration_ned_m_s2: Vector3
    yaw_rad: float
    yaw_rate_rad_s: float


class AttitudeTarget(NamedTuple):
    """Output of the outer loop and input of the inner loop: attitude and collective thrust."""

    attitude: Quaternion
    thrust_n: float


class AttitudeReference(NamedTuple):
    """The attitude target after the reference filter, with its derivatives in the body frame."""

    attitude: Quaternion
    rates_frd_rad_s: Vector3
    acceleration_frd_rad_s2: Vector3


class Wrench(NamedTuple):
    """Collective thrust along −z of the body and torque about the body axes."""

    thrust_n: float
    torque_frd_n_m: Vector3
