"""The battery in the simulator: its discharge, and its report to the flight stack.

An open-circuit voltage E that depends on the charge, behind a resistance R, feeds a constant-power load P:

    P = (E − R·I)·I    →    I = (E − √(E² − 4·R·P)) / 2R = 2P / (E + √(E² − 4·R·P))

A load above E²/4R is limited to the largest power, with the current E/2R. An empty battery supplies no power, and the
rotors stop. P is the shaft power of the rotors, Σ d·|Ω|³, over the efficiency of motors and controllers, plus the
power of the avionics.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.params.battery import Battery
from flightstack.simulator_link.battery_frame import BatteryReport
from flightstack.simulator_link.battery_kernels import EXTRA_PLACES, PLACES, UNUSED_CELL

INTERVAL_US = 500_000
"""Simulated time between two reports."""


class BatteryOptions(NamedTuple):
    """Options of the simulated battery."""

    start: float = 1.0  # initial share of the charge
    capacity_mah: float | None = None  # None: the vehicle's
    drain: float = 1.0  # factor on the discharge, not on the current


FULL = BatteryOptions()


class BatteryState(NamedTuple):
    """The battery at one instant."""

    voltage_v: float
    current_a: float
    remaining: float  # share of the charge
    consumed_mah: float
    energy_j: float


def set_battery(m: Record, battery: Battery, options: BatteryOptions) -> None:
    """Write the battery to the record of a plant."""
    m["curve_count"] = len(battery.cell_voltage_v)
    set_pack(m, battery)
    capacity_mah = battery.capacity_mah if options.capacity_mah is None else options.capacity_mah
    m["capacity"] = capacity_mah * 3.6
    m["drain"] = options.drain
    m["inverse_efficiency"] = 1.0 / battery.efficiency
    m["avionics"] = battery.avionics_w
    m["charge"] = options.start
    settle(m, 0.0)


def set_pack(m: Record, battery: Battery, extra_ohm: float = 0.0, dead_cells: int = 0) -> None:
    """Write open-circuit voltage and resistance of the pack; they act from the next step on."""
    cells = battery.cells - dead_cells
    m["curve"][: len(battery.cell_voltage_v)] = [cells * volt for volt in battery.cell_voltage_v]
    m["resistance"] = battery.resistance_ohm + extra_ohm


@compiled
def open_circuit_v(m: Record) -> float:
    """Return the open-circuit voltage at the present charge, linear between the points of the curve."""
    place = m["charge"] * (m["curve_count"] - 1)
    index = min(int(place), m["curve_count"] - 2)
    curve = m["curve"]
    voltage: float = curve[index] + (place - index) * (curve[index + 1] - curve[index])
    return voltage


@compiled
def settle(m: Record, shaft_w: float) -> None:
    """Update voltage and current for a load of the rotors [W, mechanical]."""
    volt, resistance = open_circuit_v(m), m["resistance"]
    power = shaft_w * m["inverse_efficiency"] + m["avionics"]
    if m["charge"] <= 0.0:
        power = 0.0
    root = math.sqrt(max(volt * volt - 4.0 * resistance * power, 0.0))
    current = (
        2.0 * min(power, volt * volt / (4.0 * resistance) if resistance > 0.0 else power) / (volt + root)
    )
    m["current"] = current
    m["voltage"] = volt - resistance * current


@compiled
def discharge(m: Record, shaft_w: float, step_s: float) -> None:
    """Discharge the battery by one step; the load [W, mechanical] is the mean over the step."""
    settle(m, shaft_w)
    m["consumed"] += m["current"] * step_s
    m["energy"] += m["current"] * m["voltage"] * step_s
    m["charge"] = max(m["charge"] - m["drain"] * m["current"] * step_s / m["capacity"], 0.0)


STATE_COLUMNS = len(BatteryState._fields)


@compiled
def note_battery(memory: RecordArray, row: FloatArray) -> float:
    """Write the ``BatteryState`` of the record of a plant; return the charge."""
    m = memory[0]
    row[0], row[1], row[2] = m["voltage"], m["current"], m["charge"]
    row[3], row[4] = m["consumed"] / 3.6, m["energy"]
    charge: float = m["charge"]
    return charge


def battery_state(memory: RecordArray) -> BatteryState:
    """Return the battery state from the record of a plant."""
    row = np.zeros(STATE_COLUMNS)
    note_battery(memory, row)
    return BatteryState(*row.tolist())


def battery_report(state: BatteryState, cells: int) -> BatteryReport:
    """Return the BATTERY_STATUS of a pack with equal cells."""
    in_cell = whole(state.voltage_v / cells * 1e3, 0, UNUSED_CELL - 1)
    first, more = min(cells, PLACES), max(cells - PLACES, 0)
    unused = [UNUSED_CELL] * (PLACES - first) + [in_cell] * more + [0] * (EXTRA_PLACES - more)
    return BatteryReport(
        0,
        (*[in_cell] * first, *unused),
        int16(state.current_a * 100.0),
        int32(state.consumed_mah),
        int32(state.energy_j / 100.0),
        whole(state.remaining * 100.0, 0, 100),
    )
