"""The quiet ticks of a period as one compiled call: plant, inertial sensors, filter, inner loop and rotor monitor.

It calls the kernels that each part runs in any other tick, at their addresses, on the same arrays and in the same
order. Records are passed as bytes, so that this kernel is compiled once for all of them. A module of its own, with few
imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.kernel_calls import call_kernel, call_kernel_int

ADVANCE, MEASURE, TAKE, ESTIMATE, CONTROL, FOLLOW, CALLS = range(7)
"""Kernels by their index in ``calls``."""
TICKS, FLOWN, RESULT, SENSED, COUNTERS = range(5)
"""Counters: ticks of the vehicle, advances of the plant, the last result of these, and samples of the sensors."""
_REFERENCE, _COMMAND, _SPEED = (
    columns.start for columns in (LoopRow.REFERENCE_ATTITUDE, LoopRow.ROTOR_COMMAND, LoopRow.ROTOR_SPEED)
)
_QUATERNION_AT = 6


@compiled
def _copy(source: Any, target: Any) -> None:
    for i in range(len(source)):
        target[i] = source[i]


@compiled
def _sum_at(values: FloatArray, columns: Any) -> float:
    total = 0.0
    for i in columns:
        total += values[i]
    return total


@compiled
def _sense(
    calls: Any, sensing: Any, time_us: int, interval_us: int, selected: int, record: FloatArray
) -> None:
    """Measure, and give each filter its inertial sensor's sample; ``record`` takes that of the selected one."""
    motion, imus, true_state, true_speeds, noise, wires, tracks, counters, filters, spare_record = sensing
    call_kernel(calls[MEASURE], (motion, imus, true_state, true_speeds, noise, wires))
    time_s = time_us * 1e-6
    for k in range(len(tracks)):
        sample = tracks[k][counters[k][0] % len(tracks[k])]
        kept = record if k == selected else spare_record
        call_kernel(calls[TAKE], (tracks[k], counters[k], wires[k], time_s, interval_us, kept))
        call_kernel(calls[ESTIMATE], (filters[k], sample))


@compiled
def _rest(row: FloatArray, idle: FloatArray, state: FloatArray, speeds: Any) -> None:
    """Write the row of a vehicle that must not fly: ``idle`` with the present state."""
    _copy(idle, row)
    _copy(state, row)
    for i in range(4):
        row[_REFERENCE + i] = state[_QUATERNION_AT + i]
    _copy(speeds, row[_SPEED:])


@compiled
def _control(calls: Any, control: Any, flies: bool, row: FloatArray, commands: FloatArray) -> None:
    """Write ``row`` and the commands, by the loops or for a vehicle that must not fly."""
    state, speeds, loops, fraction, fraction_step, idle, rotors, lags = control
    if flies:
        fraction[0] += fraction_step
        call_kernel(calls[CONTROL], (state, fraction[0], speeds, loops, row))
    else:
        _rest(row, idle, state, speeds)
    call_kernel(calls[FOLLOW], (row, rotors, lags))
    for i in range(len(commands)):
        commands[i] = row[_COMMAND + i]


@compiled
def fly_quiet_ticks(
    calls: Any, counters: Any, interval_us: int, plant: Any, sensing: Any, control: Any,
    count: int, time_us: int, flags: int, flies: bool, estimate: Any, log: Any, imu_log: Any,
) -> None:  # fmt: skip
    """Run ``count`` ticks, or fewer: what was done is in ``counters``.

    It stops when the result of the plant is larger than ``largest_result``, and after a reset of the estimate, counted
    in the columns ``reset_counts``: its tick waits for guidance. Records and frames are bytes. ``tracks``, ``counters``
    and ``filters`` of ``sensing`` have an element for each inertial sensor; on the true state there are no ``imus``.
    """
    memory, commands, steps, output, largest_result, sent, taken = plant
    selected, known, is_known, resets, reset_counts = estimate
    rows, row_times, row_at = log
    records, record_times, record_at = imu_log
    resets_before, has_sensors = _sum_at(resets, reset_counts), len(sensing[1]) > 0
    counters[TICKS], counters[SENSED] = 0, 0
    for i in range(count):
        result = call_kernel_int(calls[ADVANCE], (memory, commands, flags, steps, output))
        counters[FLOWN], counters[RESULT] = i + 1, result
        if result > largest_result:
            return
        time_us += interval_us
        _copy(sent, taken)
        if has_sensors:
            record_times[record_at + i] = time_us
            _sense(calls, sensing, time_us, interval_us, selected, records[record_at + i])
            counters[SENSED] = i + 1
            if is_known[0] != 0:
                _copy(known, control[0])
            if _sum_at(resets, reset_counts) != resets_before:
                return
        row_times[row_at + i] = time_us
        _control(calls, control, flies, rows[row_at + i], commands)
        counters[TICKS] = i + 1
