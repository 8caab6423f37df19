"""Effects of the faults on a plant.

``PlantFaults`` is the whole change of a plant against its vehicle file and options: a plant takes it at once, and the
default ends all faults.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from flightstack.core.contract import MAX_ROTORS, Vector3
from sim_bridge.plant.faults.table import Fault, Kind
from sim_bridge.plant.loading import AS_BUILT, Loading

_STILL = Vector3(0.0, 0.0, 0.0)


class RotorFault(NamedTuple):
    """Fault of one rotor; by default none."""

    share: float = 1.0  # of thrust and torque
    speed_rad_s: float | None = None  # commanded whatever the command
    delay_s: float = 0.0  # dead time of the command


HEALTHY = RotorFault()


@dataclass
class PlantFaults:
    """Faults and disturbances of a plant; without arguments none."""

    rotors: list[RotorFault] = field(default_factory=lambda: [HEALTHY] * MAX_ROTORS)
    loading: Loading = AS_BUILT
    wind_step_ned_m_s: Vector3 = _STILL
    gust_m_s: float | None = None  # None: that of the options
    wind_shear: float = 0.0  # exponent
    ground_effect: bool = False
    extra_resistance_ohm: float = 0.0
    dead_cells: int = 0


Effect = Callable[[PlantFaults, Fault], None]


def _set_rotor(faults: PlantFaults, fault: Fault, share: float, speed_rad_s: float | None) -> None:
    before = faults.rotors[fault.rotor]
    faults.rotors[fault.rotor] = before._replace(share=share, speed_rad_s=speed_rad_s)


def _delay_rotor(faults: PlantFaults, fault: Fault) -> None:
    faults.rotors[fault.rotor] = faults.rotors[fault.rotor]._replace(delay_s=fault.value)


def _add_payload(faults: PlantFaults, fault: Fault) -> None:
    faults.loading = faults.loading._replace(payload_kg=fault.value, payload_frd_m=fault.vector)


def _move_centre(faults: PlantFaults, fault: Fault) -> None:
    faults.loading = faults.loading._replace(centre_frd_m=fault.vector)


def _set(name: str, value: Callable[[Fault], object]) -> Effect:
    """Return the effect that sets one field."""
    return lambda faults, fault: setattr(faults, name, value(fault))


EFFECTS: Mapping[Kind, Effect] = MappingProxyType(
    {
        Kind.ROTOR_OFF: lambda faults, fault: _set_rotor(faults, fault, 1.0, 0.0),
        Kind.ROTOR_WEAK: lambda faults, fault: _set_rotor(faults, fault, fault.value, None),
        Kind.ROTOR_STUCK: lambda faults, fault: _set_rotor(faults, fault, 1.0, fault.value),
        Kind.ROTOR_DELAYED: _delay_rotor,
        Kind.PAYLOAD: _add_payload,
        Kind.CENTRE: _move_centre,
        Kind.WIND_STEP: _set("wind_step_ned_m_s", lambda fault: fault.vector),
        Kind.WIND_GUST: _set("gust_m_s", lambda fault: fault.value),
        Kind.WIND_SHEAR: _set("wind_shear", lambda fault: fault.value),
        Kind.GROUND_EFFECT: _set("ground_effect", lambda _: True),
        Kind.BATTERY_SAG: _set("extra_resistance_ohm", lambda fault: fault.value),
        Kind.BATTERY_CELL: _set("dead_cells", lambda _: 1),
    }
)
"""Effects of the faults that last. If two affect the same part, the last one wins."""


def plant_faults(active: Iterable[Fault]) -> PlantFaults:
    """Return what the active faults change in a plant."""
    faults = PlantFaults()
    for fault in active:
        if fault.kind in EFFECTS:
            EFFECTS[fault.kind](faults, fault)
    return faults
