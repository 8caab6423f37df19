"""The compared signals: outputs of each stage of the loops and the trajectory, with their names in the log."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.contract import MAX_ROTORS

TARGET, REFERENCE, WRENCH, ACTUATORS, TRAJECTORY = (
    "attitude target",
    "attitude reference",
    "wrench",
    "actuators",
    "trajectory",
)
STAGES = (TARGET, REFERENCE, WRENCH, ACTUATORS, TRAJECTORY)
"""In the order of the loops, from the output of the outer loop; the trajectory is last."""


class Signal(NamedTuple):
    """One quantity of a flight log, with all components."""

    name: str
    """Key in ``pil.json``."""
    title: str
    stage: str
    unit: str
    topic: str
    fields: tuple[str, ...]
    """Fields of the topic. Fields that a log lacks are left out: a vehicle may have fewer rotors."""
    least_scale: float
    """Smallest full scale of differences, otherwise the signal's largest value: straight up and down, torques are only
    rounding errors."""
    is_attitude: bool = False
    """True for a quaternion, whose negative is the same attitude."""


def _elements(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}[{index}]" for index in range(count))


def _attitude(name: str, title: str, stage: str, topic: str, field: str) -> Signal:
    return Signal(name, title, stage, "1", topic, _elements(field, 4), 1.0, is_attitude=True)


def _signal(
    name: str, title: str, stage: str, unit: str, least_scale: float, topic: str, *fields: str
) -> Signal:
    return Signal(name, title, stage, unit, topic, fields, least_scale)


_POSITION, _OUTER = "vehicle_local_position", "vehicle_attitude_setpoint"
_INNER, _TORQUE, _ACHIEVED = "attitude_reference", "torque_n_m", "torque_achieved_n_m"

SIGNALS = (
    _attitude("target_attitude", "target attitude", TARGET, _OUTER, "q_d"),
    _signal("target_thrust", "target thrust", TARGET, "N", 1.0, _OUTER, "thrust_n"),
    _attitude("reference_attitude", "reference attitude", REFERENCE, _INNER, "q"),
    _signal(
        *("reference_rates", "reference rates", REFERENCE, "rad/s", 1.0),
        *(_INNER, *_elements("rates_rad_s", 3)),
    ),
    _signal(
        *("reference_acceleration", "reference acceleration", REFERENCE, "rad/s²", 10.0),
        *(_INNER, *_elements("acceleration_rad_s2", 3)),
    ),
    _signal("thrust", "thrust", WRENCH, "N", 1.0, "wrench", "thrust_n"),
    _signal("torque", "torque", WRENCH, "N m", 0.1, "wrench", *_elements(_TORQUE, 3)),
    _signal("thrust_achieved", "thrust after the mixer", ACTUATORS, "N", 1.0, "wrench", "thrust_achieved_n"),
    _signal(
        *("torque_achieved", "torque after the mixer", ACTUATORS, "N m", 0.1),
        *("wrench", *_elements(_ACHIEVED, 3)),
    ),
    _signal(
        *("rotor_command", "rotor speed commands", ACTUATORS, "rad/s", 100.0),
        *("rotor_speeds", *_elements("command_rad_s", MAX_ROTORS)),
    ),
    _signal("position", "position", TRAJECTORY, "m", 1.0, _POSITION, "x", "y", "z"),
    _signal("velocity", "velocity", TRAJECTORY, "m/s", 1.0, _POSITION, "vx", "vy", "vz"),
    _attitude("attitude", "attitude", TRAJECTORY, "vehicle_attitude", "q"),
    _signal(
        *("rates", "body rates", TRAJECTORY, "rad/s", 1.0),
        *("vehicle_angular_velocity", *_elements("xyz", 3)),
    ),
)
BY_NAME = {signal.name: signal for signal in SIGNALS}
