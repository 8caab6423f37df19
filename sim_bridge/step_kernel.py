"""A step of plant, inertial sensors, magnetometer, barometer and GNSS receiver as one compiled call.

It calls the kernels that the simulator runs in any other step, at their addresses, on the same arrays and in the same
order. Records are passed as bytes, so that this kernel is compiled once for all of them. A module of its own, with few
imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.kernels.calls import call_kernel, call_kernel_float, call_kernel_int
from flightstack.core.periods import take_due
from flightstack.core.record_types import dtype_of
from flightstack.simulator_link.gps_kernels import write_gps

MAG, BARO = 0, 1
"""Sensors by the index of their times."""
PAUSES = 4
"""Bit of the result after a report that the vehicle must take before it goes on."""


class StepCalls(NamedTuple):
    """Addresses of the kernels, 0 without one."""

    advance: int
    measure: int
    measure_mag: int
    measure_baro: int
    airspeed: int
    receive_gnss: int
    note_battery: int


STEP_CALLS = dtype_of(StepCalls)


@compiled
def _next_row(cursor: Any) -> int:
    """Return the index of the next row of a stream of deviates."""
    at: int = cursor[0]
    cursor[0] = at + 1
    return at


@compiled
def _measure_slow(
    calls: Any, slow: Any, news: Any, time_us: int, memory: Any, state: FloatArray, rotor_speeds: Any
) -> None:
    """Measure with the sensors that are due; ``memory`` has the bytes of the plant."""
    due_us, period_us, parts, mag, baro, gnss = slow
    if take_due(due_us, period_us, MAG, time_us):
        mags, out, noise, cursor, current_a = mag
        call_kernel(calls["measure_mag"], (mags, state, current_a[0], noise[_next_row(cursor)]))
        for i in range(3):
            parts[0]["mag_gauss"][i] = out[i]
        news["has_mag"] = 1
    if take_due(due_us, period_us, BARO, time_us):
        baros, out, noise, cursor = baro
        airspeed_m_s = call_kernel_float(calls["airspeed"], (memory,))
        call_kernel(
            calls["measure_baro"],
            (baros, time_us, state, airspeed_m_s, rotor_speeds, noise[_next_row(cursor)]),
        )
        values = parts[0]
        values["pressure_hpa"], values["altitude_m"], values["temperature_c"] = out[0], out[1], out[2]
        news["has_baro"] = 1
    receiver, fix_due_us, fix, payload = gnss
    if time_us >= fix_due_us[0] and call_kernel_int(calls["receive_gnss"], (receiver, time_us, state)) != 0:
        write_gps(payload, time_us, fix)
        news["has_gnss"] = 1


@compiled
def _notes_battery(calls: Any, battery: Any, time_us: int, memory: Any) -> bool:
    """Note the battery if it is due; return True if the vehicle must take this report before it goes on."""
    due_us, period_us, least_charge, rows, times_us, count = battery
    if not take_due(due_us, period_us, 0, time_us):
        return False
    at = count[0]
    charge = call_kernel_float(calls["note_battery"], (memory, rows[at]))
    times_us[at] = time_us
    count[0] = at + 1
    return bool(charge <= least_charge[0] or at + 1 == len(rows))


@compiled
def simulate(world: Any, time_us: int, flags: int) -> int:
    """Advance plant and sensors to ``time_us``, the simulator's time; return the bits of the plant's kernel.

    ``flags`` are those of FS_ACTUATORS. After a result above that of contact nothing is measured. ``PAUSES`` is a
    further bit: a report of the battery is due that the vehicle may act on.
    """
    calls_array, plant, sensing, slow, news_array, battery = world
    memory, commands, steps, output, largest_result, sent, taken = plant
    motion, imus, state, rotor_speeds, noise, wires = sensing
    calls, news = calls_array[0], news_array[0]
    result: int = call_kernel_int(calls["advance"], (memory, commands, flags, steps, output))
    if result > largest_result:
        return result
    copy_all(sent, taken)
    news["has_mag"], news["has_baro"], news["has_gnss"] = 0, 0, 0
    if len(imus) > 0:
        _measure_slow(calls, slow, news, time_us, memory, state, rotor_speeds)
        call_kernel(calls["measure"], (motion, imus, state, rotor_speeds, noise, wires))
    if _notes_battery(calls, battery, time_us, memory):
        result |= PAUSES
    return result
