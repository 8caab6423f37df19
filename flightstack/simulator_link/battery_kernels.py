"""The payload of BATTERY_STATUS in compiled code, with the values that ``battery_frame`` writes and reads.

A module of its own, with few imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any

from flightstack.core.array_items import as_tuple
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.portable_math import whole_within
from flightstack.simulator_link.frame_kernels import read_bytes, write_bytes

BATTERY_SIZE = 54
PLACES, EXTRA_PLACES = 10, 4
"""Numbers of cells in ``voltages`` and in ``voltages_ext``."""
UNUSED_CELL = 0xFFFF
"""Value of an unused entry of ``voltages``; in ``voltages_ext`` it is zero."""
_ENERGY_AT, _CELLS_AT, _CURRENT_AT, _NUMBER_AT, _REMAINING_AT, _EXTRA_CELLS_AT = 4, 10, 30, 32, 35, 41
_LARGEST = 2.0**31 - 1.0


@compiled
def write_battery(payload: Any, state: FloatArray, cells: int) -> None:
    """Write the report of a pack with equal cells; values beyond the fields are limited.

    ``state`` has voltage [V], current [A], remaining share of the charge, used charge [mAh] and energy [J]. The bytes
    that are the same in all reports stay as they are.
    """
    voltage_v, current_a, remaining, consumed_mah, energy_j = as_tuple(state, 5)
    in_cell_mv = whole_within(voltage_v / cells * 1e3, 0.0, UNUSED_CELL - 1.0)
    write_bytes(payload, 0, 4, whole_within(consumed_mah, -_LARGEST - 1.0, _LARGEST))
    write_bytes(payload, _ENERGY_AT, 4, whole_within(energy_j / 100.0, -_LARGEST - 1.0, _LARGEST))
    for k in range(PLACES):
        write_bytes(payload, _CELLS_AT + 2 * k, 2, in_cell_mv if k < cells else UNUSED_CELL)
    for k in range(EXTRA_PLACES):
        write_bytes(payload, _EXTRA_CELLS_AT + 2 * k, 2, in_cell_mv if PLACES + k < cells else 0)
    write_bytes(payload, _CURRENT_AT, 2, whole_within(current_a * 100.0, -32768.0, 32767.0))
    write_bytes(payload, _REMAINING_AT, 1, whole_within(remaining * 100.0, 0.0, 100.0))


@compiled
def has_more_charge(payload: Any, least_charge: float) -> bool:
    """Return True if the report is that of the first battery, which has more than this share of its charge.

    The zeros at the end of ``payload`` may be left out. A charge that is not known is not more.
    """
    if len(payload) <= _REMAINING_AT:
        return False
    number, percent = read_bytes(payload, _NUMBER_AT, 1), read_bytes(payload, _REMAINING_AT, 1)
    return bool(number == 0 and percent <= 100 and percent * 0.01 > least_charge)
