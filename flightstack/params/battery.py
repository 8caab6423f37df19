"""Battery of a vehicle: the optional table ``[battery]`` of a vehicle file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from flightstack.params.toml_file import Table

MAX_CELLS = 14
"""Number of cell voltages in BATTERY_STATUS."""

MAX_CURVE_POINTS = 32

LIPO_CELL_V = (3.27, 3.69, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20)
"""Open-circuit voltage of a lithium-polymer cell at 0 %, 10 % … 100 % charge, as commonly published for
cells at rest."""


@dataclass(frozen=True)
class Battery:
    """A pack of equal cells in series: a charge-dependent open-circuit voltage and an internal resistance.

    ``cell_voltage_v`` holds voltages at equal steps of charge, from empty to full. ``efficiency`` is the ratio of
    mechanical rotor power to electric power; ``avionics_w`` is the power of all other consumers.
    """

    cells: int
    capacity_mah: float
    resistance_ohm: float
    cell_voltage_v: tuple[float, ...] = LIPO_CELL_V
    efficiency: float = 0.75
    avionics_w: float = 5.0


def read_battery(top: Table) -> Battery | None:
    """Read the table ``[battery]``, or return None without one; raise ConfigError."""
    if not top.has("battery"):
        return None
    table = top.table("battery")
    cells = table.number("cells", 1, MAX_CELLS)
    if not cells.is_integer():
        raise table.error("cells", f"{cells:g} is not a whole number")
    points = table.number_list("cell_voltage_v", 2, MAX_CURVE_POINTS, 0.5, 5.0, LIPO_CELL_V)
    if any(after < before for before, after in pairwise(points)):
        raise table.error("cell_voltage_v", "must not decrease: it goes from empty to full")
    battery = Battery(
        cells=int(cells),
        capacity_mah=table.number("capacity_mah", 1.0, 1e6),
        resistance_ohm=table.number("resistance_ohm", 0.0, 10.0, 0.0),
        cell_voltage_v=points,
        efficiency=table.number("efficiency", 0.05, 1.0, 0.75),
        avionics_w=table.number("avionics_w", 0.0, 1e4, 5.0),
    )
    table.finish()
    return battery
