"""The battery in the simulator: how fast it empties, and what tells the flight stack.

An open-circuit voltage E that depends on the charge, behind a resistance R, feeds a constant-power load P:

    P = (E − R·I)·I    →    I = (E − √(E² − 4·R·P)) / 2R = 2P / (E + √(E² − 4·R·P))

A load above E²/4R cannot be fed: the current then is that of the largest power, E/2R. An empty battery gives
nothing, and the rotors stop. P is the shaft power of the rotors, Σ d·|Ω|³, over the efficiency of motors and
controllers, and what the avionics take.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import Record
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.params.battery import Battery
from flightstack.simulator_link.battery_frame import EXTRA_PLACES, PLACES, UNUSED_CELL, BatteryReport

INTERVAL_US = 100_000
"""Simulated time between two messages."""


class BatteryOptions(NamedTuple):
    """What a run of the simulator chooses about the battery."""

    start: float = 1.0  # share of the charge at the beginning
    capacity_mah: float | None = None  # None: the vehicle's
    drain: float = 1.0  # the charge falls so many times as fast as the current says


FULL = BatteryOptions()


class BatteryState(NamedTuple):
    """The battery at one instant."""

    voltage_v: float
    current_a: float
    remaining: float  # share of the charge
    consumed_mah: float
    energy_j: float


def set_battery(m: Record, battery: Battery, options: BatteryOptions) -> None:
    """Put the battery into the record of a plant."""
    count = len(battery.cell_voltage_v)
    m["curve_count"] = count
    m["curve"][:count] = [battery.cells * volt for volt in battery.cell_voltage_v]
    m["resistance"] = battery.resistance_ohm
    capacity_mah = battery.capacity_mah if options.capacity_mah is None else options.capacity_mah
    m["capacity"] = capacity_mah * 3.6
    m["drain"] = options.drain
    m["inverse_efficiency"] = 1.0 / battery.efficiency
    m["avionics"] = battery.avionics_w
    m["charge"] = options.start
    settle(m, 0.0)


@compiled
def open_circuit_v(m: Record) -> float:
    """Open-circuit voltage at the present charge, linear between the points of the curve."""
    place = m["charge"] * (m["curve_count"] - 1)
    index = min(int(place), m["curve_count"] - 2)
    curve = m["curve"]
    voltage: float = curve[index] + (place - index) * (curve[index + 1] - curve[index])
    return voltage


@compiled
def settle(m: Record, shaft_w: float) -> None:
    """Write voltage and current under a load of the rotors [W, mechanical]."""
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
    """Take the charge of one step out of the battery; the load [W, mechanical] is the mean over the step."""
    settle(m, shaft_w)
    m["consumed"] += m["current"] * step_s
    m["energy"] += m["current"] * m["voltage"] * step_s
    m["charge"] = max(m["charge"] - m["drain"] * m["current"] * step_s / m["capacity"], 0.0)


def battery_state(m: Record) -> BatteryState:
    """Read the battery out of the record of a plant."""
    return BatteryState(
        float(m["voltage"]),
        float(m["current"]),
        float(m["charge"]),
        float(m["consumed"]) / 3.6,
        float(m["energy"]),
    )


def battery_report(state: BatteryState, cells: int) -> BatteryReport:
    """BATTERY_STATUS of a pack whose cells are equal."""
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
