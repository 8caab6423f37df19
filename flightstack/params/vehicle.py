"""Vehicle definition: mass, inertia and rotors, read from a TOML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.errors import ConfigError
from flightstack.core.linear_algebra import pseudo_inverse
from flightstack.params.battery import Battery, read_battery
from flightstack.params.behaviour import SPECS, Behaviour
from flightstack.params.sensors import NO_SENSORS, Sensors, read_sensors
from flightstack.params.toml_file import (
    Table,
    built_in_names,
    find_file,
    hidden_file,
    parse_toml,
    read_text,
    read_toml,
    set_value,
)
from flightstack.params.vehicle_defaults import Defaults, read_defaults
from flightstack.params.vehicle_parts import Part, read_parts

BUILT_IN = Path(__file__).parent / "vehicles"
DEFAULT_VEHICLE = "paper_quad"
KIND = "a built-in vehicle"
GRAVITY_M_S2 = 9.81  # the paper's Table I
SYSTEM_TYPES = {3: 15, 4: 2, 6: 13, 8: 14}
"""MAV_TYPE by number of rotors: tricopter, quadrotor, hexarotor, octorotor."""
GENERIC_MULTIROTOR = 43
"""MAV_TYPE of any other number of rotors."""


def system_type(rotors: int) -> int:
    """Return the MAV_TYPE of a vehicle with this number of rotors."""
    return SYSTEM_TYPES.get(rotors, GENERIC_MULTIROTOR)


NO_DRAG_PLANT = "paper"
"""Plant that ignores the vehicle's drag."""


@dataclass(frozen=True)
class Rotor:
    """One rotor. ``spin`` is +1 clockwise seen from above (about +z of FRD), −1 counter-clockwise."""

    position_frd_m: tuple[float, float, float]
    spin: int
    thrust_coefficient_n_s2: float
    torque_coefficient_n_m_s2: float
    inertia_kg_m2: float
    lag_s: float
    min_speed_rad_s: float
    max_speed_rad_s: float
    max_drive_torque_n_m: float = math.inf
    """Maximum motor torque, for acceleration and air drag; applies to rotors with a lag."""


@dataclass(frozen=True)
class Vehicle:
    """A multirotor. Body axes are principal axes, the origin is the centre of gravity."""

    name: str
    description: str
    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    linear_drag_n_s_m: tuple[float, float, float]
    leg_height_m: float
    rotors: tuple[Rotor, ...]
    optional_drag_n_s_m: tuple[float, float, float] | None = None
    """Drag enabled by ``with_drag``, for a vehicle without drag by default."""
    ideal_rotors: bool = False
    battery: Battery | None = None
    parts: tuple[Part, ...] = ()
    """Parts for the multibody plant."""
    default_parts: bool = True
    """Add the parts of a typical multirotor that are not in ``parts`` by name."""
    sensors: Sensors = NO_SENSORS
    default_params: Defaults = ()
    """Parameters whose default is another one for this vehicle."""

    @property
    def behaviour(self) -> Behaviour:
        """Return the parameters of guidance and commander, with this vehicle's defaults."""
        behaviour = Behaviour()
        for name, value in self.default_params:
            behaviour = behaviour.updated(name, value) if name in SPECS else behaviour
        return behaviour

    @property
    def weight_n(self) -> float:
        """Weight at the paper's gravity."""
        return self.mass_kg * GRAVITY_M_S2

    @property
    def max_thrust_n(self) -> float:
        """Thrust of all rotors at maximum speed."""
        return math.fsum(
            r.thrust_coefficient_n_s2 * r.max_speed_rad_s * r.max_speed_rad_s for r in self.rotors
        )

    @property
    def full_thrust_n(self) -> float:
        """Thrust of a normalised thrust setpoint of 1; twice the weight for ideal rotors, which have no limit."""
        return 2.0 * self.weight_n if self.ideal_rotors else self.max_thrust_n

    @property
    def mean_rotor_inertia_kg_m2(self) -> float:
        """Mean inertia of the rotors about their axes."""
        return math.fsum(r.inertia_kg_m2 for r in self.rotors) / len(self.rotors)

    def effectiveness(self) -> FloatArray:
        """Return the matrix from Ω² [rad²/s²] to (thrust [N], torque FRD [N m]), shape (4, rotors)."""
        matrix = np.zeros((4, len(self.rotors)))
        for column, rotor in enumerate(self.rotors):
            x, y, _ = rotor.position_frd_m
            b = rotor.thrust_coefficient_n_s2
            # r × F with F = (0, 0, −bΩ²), and the reaction torque of rotor drag
            matrix[:, column] = (b, -y * b, x * b, -rotor.spin * rotor.torque_coefficient_n_m_s2)
        return matrix

    def allocation(self) -> FloatArray:
        """Return the matrix from (thrust [N], torque FRD [N m]) to Ω² [rad²/s²], shape (rotors, 4).

        The pseudo-inverse of ``effectiveness``: the least-squares Ω² for a wrench.
        """
        return pseudo_inverse(self.effectiveness())

    def hover_speeds_squared(self) -> list[float]:
        """Return Ω² [rad²/s²] of each rotor in hover."""
        return [share * self.weight_n for share in self.allocation()[:, 0].tolist()]

    def with_drag(self, plant: str) -> Vehicle:
        """Return the vehicle with the optional drag of its file; raise ConfigError without one or without effect."""
        if plant == NO_DRAG_PLANT:
            raise ConfigError("--drag", "", "the paper's model has no drag; use --plant rigid or multibody")
        if self.optional_drag_n_s_m is None:
            needs = f"the file of the vehicle {self.name} has no optional_drag_n_s_m"
            flies = "; its linear_drag_n_s_m acts anyway" if any(self.linear_drag_n_s_m) else ""
            raise ConfigError("--drag", "", needs + flies)
        return replace(self, linear_drag_n_s_m=self.optional_drag_n_s_m)

    def wind_refusal(self, plant: str) -> str | None:
        """Return why wind has no effect in this plant and the remedy, or None if it has."""
        if plant == NO_DRAG_PLANT:
            return "wind cannot act: the paper's model has no drag; use --plant rigid or multibody"
        if any(self.linear_drag_n_s_m):
            return None
        remedy = "add --drag" if self.optional_drag_n_s_m is not None else "set linear_drag_n_s_m in its file"
        return f"wind cannot act: the vehicle {self.name} has no drag; {remedy}"

    def with_ideal_rotors(self) -> Vehicle:
        """Return the vehicle with rotors without lag and limits, as in the paper.

        Their speeds are imposed, so that plants also omit the spin-up torque.
        """
        low, high = -math.inf, math.inf
        rotors = tuple(
            replace(r, lag_s=0.0, min_speed_rad_s=low, max_speed_rad_s=high, max_drive_torque_n_m=high)
            for r in self.rotors
        )
        return replace(self, rotors=rotors, ideal_rotors=True)


def built_in_vehicles() -> list[str]:
    """Return the names of the built-in vehicles."""
    return built_in_names(BUILT_IN)


def hidden_vehicle(name_or_path: str) -> str | None:
    """Return a warning if a built-in name hides a file in the working directory, or None."""
    return hidden_file(name_or_path, KIND)


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a built-in vehicle by name or a TOML file by path; raise ConfigError."""
    file = find_file(name_or_path, BUILT_IN, KIND)
    return _loaded(file, read_text(file))


@lru_cache(maxsize=16)
def _loaded(file: Path, text: str) -> Vehicle:
    """Return the vehicle of a file with this text."""
    return _vehicle(parse_toml(file, text))


def load_vehicle_with(name_or_path: str, numbers: Mapping[str, float]) -> Vehicle:
    """Read a vehicle with other numbers than those of its file, by their paths; raise ConfigError.

    With another mass the rotors keep their speeds: ``thrust_to_weight`` counts for the mass of the file.

    >>> load_vehicle_with("x_quad", {"body.mass_kg": 1.8, "rotor_type.lag_s": 0.03}).mass_kg
    1.8
    """
    file = find_file(name_or_path, BUILT_IN, KIND)
    values = read_toml(file).values()
    ratio = {path: number for path, number in numbers.items() if path == _RATIO}
    _set_numbers(file, values, ratio)
    base = _vehicle(Table(file, values)) if ratio else load_vehicle(name_or_path)
    speed_rad_s = base.rotors[0].max_speed_rad_s
    values["rotor_type"].pop("thrust_to_weight", None)
    values["rotor_type"]["max_speed_rad_s"] = speed_rad_s
    _set_numbers(file, values, {path: number for path, number in numbers.items() if path != _RATIO})
    return _vehicle(Table(file, values))


_RATIO = "rotor_type.thrust_to_weight"


def _set_numbers(file: Path, values: dict[str, Any], numbers: Mapping[str, float]) -> None:
    for path, number in numbers.items():
        if path.startswith("params."):
            raise ConfigError(file, path, "is no number of the vehicle: set the parameter itself")
        try:
            set_value(values, path, number)
        except KeyError as error:
            raise ConfigError(file, path, error.args[0]) from None


def _vehicle(top: Table) -> Vehicle:
    body, rotor_type = top.table("body"), top.table("rotor_type")
    mass_kg = body.number("mass_kg", 1e-3, 1e3)
    inertia = body.numbers("inertia_kg_m2", 3, 1e-8, 1e4)
    ix, iy, iz = inertia
    if ix + iy < iz or iy + iz < ix or iz + ix < iy:
        raise body.error(
            "inertia_kg_m2", "no rigid body has it: each must be at most the sum of the other two"
        )
    vehicle = Vehicle(
        name=top.text("name"),
        description=top.text("description", ""),
        mass_kg=mass_kg,
        inertia_kg_m2=(ix, iy, iz),
        linear_drag_n_s_m=body.numbers("linear_drag_n_s_m", 3, 0.0, 1e3, (0.0, 0.0, 0.0)),  # type: ignore[arg-type]
        leg_height_m=body.number("leg_height_m", 0.0, 10.0, 0.1),
        rotors=_rotors(top, rotor_type, mass_kg),
        optional_drag_n_s_m=_optional_drag(body),
        battery=read_battery(top),
        parts=read_parts(top),
        default_parts=top.flag("default_parts", True),
        sensors=read_sensors(top),
        default_params=read_defaults(top),
    )
    for table in (top, body, rotor_type):
        table.finish()
    _check_geometry(top, vehicle)
    return vehicle


def _optional_drag(body: Table) -> tuple[float, float, float] | None:
    if not body.has("optional_drag_n_s_m"):
        return None
    x, y, z = body.numbers("optional_drag_n_s_m", 3, 0.0, 1e3)
    if not any((x, y, z)):
        raise body.error("optional_drag_n_s_m", "is zero: leave it out")
    return x, y, z


def _rotors(top: Table, rotor_type: Table, mass_kg: float) -> tuple[Rotor, ...]:
    entries = top.tables("rotor")
    if not 4 <= len(entries) <= MAX_ROTORS:
        raise top.error("rotor", f"{len(entries)} rotors given, 4 to {MAX_ROTORS} are allowed")
    thrust_coefficient = rotor_type.number("thrust_coefficient_n_s2", 1e-12, 1.0)
    min_speed = rotor_type.number("min_speed_rad_s", 0.0, 1e5, 0.0)
    if not (rotor_type.has("max_speed_rad_s") or rotor_type.has("thrust_to_weight")):
        raise rotor_type.missing("max_speed_rad_s", "thrust_to_weight")
    if rotor_type.has("max_speed_rad_s"):
        max_speed = rotor_type.number("max_speed_rad_s", 1.0, 1e5)
    else:
        ratio = rotor_type.number("thrust_to_weight", 1.05, 20.0)
        max_speed = math.sqrt(ratio * mass_kg * GRAVITY_M_S2 / (len(entries) * thrust_coefficient))
    if min_speed >= max_speed:
        raise rotor_type.error(
            "min_speed_rad_s", f"{min_speed:g} is not below the largest speed {max_speed:g}"
        )
    torque_coefficient = rotor_type.number("torque_coefficient_n_m_s2", 1e-15, 1.0)
    inertia = rotor_type.number("inertia_kg_m2", 0.0, 1.0, 0.0)
    lag_s = rotor_type.number("lag_s", 0.0, 1.0, 0.0)
    drive_torque = _drive_torque(rotor_type, lag_s, inertia)
    rotors = []
    for entry in entries:
        x, y, z = entry.numbers("position_frd_m", 3, -10.0, 10.0)
        spin = 1 if entry.choice("spin", ("cw", "ccw")) == "cw" else -1
        entry.finish()
        rotors.append(
            Rotor(
                (x, y, z),
                spin,
                thrust_coefficient,
                torque_coefficient,
                inertia,
                lag_s,
                min_speed,
                max_speed,
                drive_torque,
            )
        )
    return tuple(rotors)


def _drive_torque(rotor_type: Table, lag_s: float, inertia_kg_m2: float) -> float:
    """Read the maximum motor torque; infinite if not given."""
    if not rotor_type.has("max_drive_torque_n_m"):
        return math.inf
    if lag_s == 0.0 or inertia_kg_m2 == 0.0:
        raise rotor_type.error("max_drive_torque_n_m", "needs a lag_s and an inertia_kg_m2 above 0")
    return rotor_type.number("max_drive_torque_n_m", 1e-9, 1e3)


def _check_geometry(top: Table, vehicle: Vehicle) -> None:
    matrix = vehicle.effectiveness()
    scaled = matrix / np.maximum(np.abs(matrix).max(axis=1, keepdims=True), 1e-300)
    if np.linalg.matrix_rank(scaled, tol=1e-6) < 4:
        raise top.error(
            "rotor",
            "the rotor geometry is singular: it does not make thrust, roll, pitch and yaw each by itself",
        )
    for number, (rotor, squared) in enumerate(
        zip(vehicle.rotors, vehicle.hover_speeds_squared(), strict=True), 1
    ):
        needed, low, high = math.sqrt(max(squared, 0.0)), rotor.min_speed_rad_s, rotor.max_speed_rad_s
        if squared <= 0.0 or not low < needed < high:
            needs = f"number {number} would need {needed:.0f} rad/s, its range is {low:.0f} to {high:.0f}"
            raise top.error("rotor", f"the rotors cannot hold the vehicle in hover: {needs}")
        drag_torque = rotor.torque_coefficient_n_m_s2 * squared
        if drag_torque >= rotor.max_drive_torque_n_m:
            torque = f"number {number} needs {drag_torque:.3g} N m against the drag alone"
            raise top.error("rotor_type.max_drive_torque_n_m", f"cannot hold the vehicle in hover: {torque}")
