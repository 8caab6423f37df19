"""The throttle of a flight from its ULog. Pure."""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.params.vehicle import GRAVITY_M_S2
from gcs_cli.logs.motion import Samples, elements
from gcs_cli.logs.recording import Recording

_IDEAL_THRUST_TO_WEIGHT = 2.0
"""Thrust of 100 % for ideal rotors, which have no limit, in weights."""


def throttle_of(recording: Recording) -> Samples:
    """Return the throttle, 0 to 1; without samples if the log has none.

    PX4 logs it as its thrust setpoint. This flight stack logs the commanded rotor speeds; thrust is proportional to
    their squares.
    """
    for topic, value in (
        ("vehicle_thrust_setpoint", _setpoint),
        ("rotor_speeds", _of_rotors),
        ("wrench", _of_ideal_rotors),
    ):
        found = recording.topic(topic)
        values = None if found is None else value(recording)
        if found is not None and values is not None:
            return Samples(found.time_us, values[:, None])
    return Samples(np.zeros(0), np.zeros((0, 1)))


def _columns(recording: Recording, topic: str, names: tuple[str, ...]) -> FloatArray | None:
    found = recording.topic(topic)
    return None if found is None else found.columns(list(names))


def _number(recording: Recording, name: str) -> float | None:
    value = recording.info.get(name)
    return float(value) if isinstance(value, int | float) and value > 0 else None


def _setpoint(recording: Recording) -> FloatArray | None:
    thrust = _columns(recording, "vehicle_thrust_setpoint", elements("xyz", 3))
    return None if thrust is None else np.linalg.norm(thrust, axis=1)


def _of_rotors(recording: Recording) -> FloatArray | None:
    largest, count = _number(recording, "rotor_max_speed_rad_s"), _number(recording, "rotor_count")
    if largest is None or count is None:
        return None
    speeds = _columns(recording, "rotor_speeds", elements("command_rad_s", int(count)))
    if speeds is None:
        return None
    throttle: FloatArray = np.mean((speeds / largest) ** 2, axis=1)
    return throttle


def _of_ideal_rotors(recording: Recording) -> FloatArray | None:
    mass_kg = _number(recording, "mass_kg")
    thrust_n = _columns(recording, "wrench", ("thrust_achieved_n",))
    if mass_kg is None or thrust_n is None:
        return None
    return thrust_n[:, 0] / (_IDEAL_THRUST_TO_WEIGHT * mass_kg * GRAVITY_M_S2)
