"""What is compared: the output of each stage of the loops and the flight that comes of it, as the log names them."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.contract import MAX_ROTORS

TARGET, REFERENCE, WRENCH, ACTUATORS, TRAJECTORY = (
    "attitude target",
    "attitude reference",
    "wrench",
    "actuators",
    "trajectory",
)
STAGES = (TARGET, REFERENCE, WRENCH, ACTUATORS, TRAJECTORY)
"""From the outer loop's output on; the trajectory is what the vehicle does with it."""


class Signal(NamedTuple):
    """One quantity of a flight log; all its components together."""

    name: str
    """Key in ``pil.json``."""
    title: str
    stage: str
    unit: str
    topic: str
    fields: tuple[str, ...]
    """Of the topic; those that a log does not have are left out: a vehicle may have fewer rotors."""
    is_attitude: bool = False
    """A quaternion: its negative is the same attitude."""


def _elements(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}[{index}]" for index in range(count))


def _attitude(name: str, title: str, stage: str, topic: str, field: str) -> Signal:
    return Signal(name, title, stage, "1", topic, _elements(field, 4), is_attitude=True)


_TORQUE, _ACHIEVED = _elements("torque_n_m", 3), _elements("torque_achieved_n_m", 3)

SIGNALS = (
    _attitude("target_attitude", "target attitude", TARGET, "vehicle_attitude_setpoint", "q_d"),
    Signal("target_thrust", "target thrust", TARGET, "N", "vehicle_attitude_setpoint", ("thrust_n",)),
    _attitude("reference_attitude", "reference attitude", REFERENCE, "attitude_reference", "q"),
    Signal(
        *("reference_rates", "reference rates", REFERENCE, "rad/s", "attitude_reference"),
        _elements("rates_rad_s", 3),
    ),
    Signal(
        *("reference_acceleration", "reference acceleration", REFERENCE, "rad/s²", "attitude_reference"),
        _elements("acceleration_rad_s2", 3),
    ),
    Signal("thrust", "thrust", WRENCH, "N", "wrench", ("thrust_n",)),
    Signal("torque", "torque", WRENCH, "N m", "wrench", _TORQUE),
    Signal("thrust_achieved", "thrust after the mixer", ACTUATORS, "N", "wrench", ("thrust_achieved_n",)),
    Signal("torque_achieved", "torque after the mixer", ACTUATORS, "N m", "wrench", _ACHIEVED),
    Signal(
        *("rotor_command", "rotor speed commands", ACTUATORS, "rad/s", "rotor_speeds"),
        _elements("command_rad_s", MAX_ROTORS),
    ),
    Signal("position", "position", TRAJECTORY, "m", "vehicle_local_position", ("x", "y", "z")),
    Signal("velocity", "velocity", TRAJECTORY, "m/s", "vehicle_local_position", ("vx", "vy", "vz")),
    _attitude("attitude", "attitude", TRAJECTORY, "vehicle_attitude", "q"),
    Signal("rates", "body rates", TRAJECTORY, "rad/s", "vehicle_angular_velocity", _elements("xyz", 3)),
)
BY_NAME = {signal.name: signal for signal in SIGNALS}
