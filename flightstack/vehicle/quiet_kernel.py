"""Quiet ticks as one compiled call: plant, sensors, filter, inner loop, rotor monitor, nominal outer ticks.

It calls the kernels that each part runs in any other tick, at their addresses, on the same arrays and in the same
order. Records are passed as bytes, so that this kernel is compiled once for all of them. A module of its own, with few
imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.kernel_calls import call_kernel, call_kernel_int
from flightstack.core.record_types import dtype_of
from flightstack.vehicle.outer_kernel import copy_all, guide, note_outer
from flightstack.vehicle.slow_kernel import log_truth, measure_slow, take_slow

_REFERENCE, _COMMAND, _SPEED = (
    columns.start for columns in (LoopRow.REFERENCE_ATTITUDE, LoopRow.ROTOR_COMMAND, LoopRow.ROTOR_SPEED)
)


class QuietCalls(NamedTuple):
    """Addresses of the kernels; those of the sensors are 0 on the true state."""

    advance: int
    control: int
    follow: int
    measure: int
    take: int
    estimate: int


class QuietCounters(NamedTuple):
    """What the kernel did."""

    ticks: int
    """Of the vehicle."""
    flown: int
    """Advances of the plant."""
    result: int
    """Of the last advance."""
    sensed: int
    """Samples of the inertial sensors."""
    waits: int
    """1 if a tick is begun that must be run in Python."""


QUIET_CALLS, QUIET_COUNTERS = dtype_of(QuietCalls), dtype_of(QuietCounters)


@compiled
def _total(numbers: Any) -> float:
    position, velocity, yaw = numbers
    total: float = position[0] + velocity[0] + yaw[0]
    return total


@compiled
def _sense(
    calls: Any, sensing: Any, time_us: int, interval_us: int, selected: int, record: FloatArray
) -> None:
    """Measure with the inertial sensors, and give each filter its sample; ``record`` takes that of the selected one."""
    motion, imus, true_state, true_speeds, noise, wires, tracks, rings, filters, spare_record = sensing
    call_kernel(calls["measure"], (motion, imus, true_state, true_speeds, noise, wires))
    time_s = time_us * 1e-6
    for k in range(len(tracks)):
        rows, taken = rings[k]
        sample = rows[taken[0] % len(rows)]
        kept = record if k == selected else spare_record
        call_kernel(calls["take"], (tracks[k], wires[k], time_s, interval_us, kept))
        call_kernel(calls["estimate"], (filters[k], sample))


@compiled
def _rest(row: FloatArray, idle: FloatArray, state: FloatArray, speeds: Any) -> None:
    """Write the row of a vehicle that must not fly: ``idle`` with the present state."""
    copy_all(idle, row)
    copy_all(state, row)
    copy_all(state[6:10], row[_REFERENCE:])
    copy_all(speeds, row[_SPEED:])


@compiled
def _control(calls: Any, control: Any, flies: bool, row: FloatArray, commands: FloatArray) -> None:
    """Write ``row`` and the commands, by the loops or for a vehicle that must not fly."""
    state, speeds, loops, fraction, fraction_step, idle, rotors, lags = control
    if flies:
        fraction[0] += fraction_step
        call_kernel(calls["control"], (state, fraction[0], speeds, loops, row))
    else:
        _rest(row, idle, state, speeds)
    call_kernel(calls["follow"], (row, rotors, lags))
    for i in range(len(commands)):
        commands[i] = row[_COMMAND + i]


@compiled
def _advance(
    calls: Any, slow_calls: Any, counters: Any, interval_us: int, plant: Any, sensing: Any, slow: Any,
    state: FloatArray, time_us: int, flags: int, estimate: Any, following: Any, imu_log: Any,
) -> bool:  # fmt: skip
    """Advance plant, sensors and estimate to ``time_us``; return False if no tick is to follow."""
    memory, commands, steps, output, largest_result, sent, taken = plant
    selected, known, is_known, resets = estimate
    records, record_times, record_at = imu_log
    result = call_kernel_int(calls["advance"], (memory, commands, flags, steps, output))
    counters["flown"] += 1
    counters["result"] = result
    if result > largest_result:
        return False
    copy_all(sent, taken)
    if len(sensing[1]) > 0:
        resets_before = _total(resets)
        at = record_at + counters["sensed"]
        record_times[at] = time_us
        measure_slow(slow_calls, slow, time_us + following[4], memory, sensing[2], sensing[3])
        _sense(calls, sensing, time_us, interval_us, selected, records[at])
        take_slow(slow_calls, slow, time_us, sensing[8], following)
        counters["sensed"] += 1
        if is_known[0] != 0:
            copy_all(known, state)
        log_truth(slow, time_us, following)
        if _total(resets) != resets_before:
            counters["waits"] = 1
            return False
    return True


@compiled
def fly_quiet_ticks(
    calls_of: Any, counters_array: Any, interval_us: int, divisor: int, plant: Any,
    sensing: Any, slow: Any, control: Any, count: int, is_taken: bool, outer_in: int, time_us: int, flags: int,
    flies: bool, last_row: FloatArray, estimate: Any, following: Any, outer: Any, log: Any, imu_log: Any,
) -> None:  # fmt: skip
    """Run ``count`` ticks, or fewer: what was done is in ``counters_array``, ``marks`` and ``slow``.

    The state of the first tick ``is_taken``, or the plant advances to it. The first outer tick is that after
    ``outer_in`` ticks. It stops when the result of the plant is larger than ``largest_result``, after a reset of the
    estimate, which it counts in ``resets``, and at an outer tick that is not nominal: their tick waits.
    Records and frames are bytes. ``tracks``, ``rings`` and ``filters`` of ``sensing`` have an element for each
    inertial sensor; on the true state there are no ``imus``. ``slow`` and ``following`` are those of ``slow_kernel``.
    """
    rows, row_times, row_at = log
    calls, outer_calls, slow_calls = calls_of[0][0], calls_of[1][0], calls_of[2][0]
    state, row, counters, marks = control[0], last_row, counters_array[0], outer[0][0]
    counters["ticks"], counters["flown"], counters["result"], counters["sensed"] = 0, 0, 0, 0
    counters["waits"] = 0
    marks["outers"], marks["fell_us"], marks["found"] = 0, 0, 0
    for i in range(count):
        time_us += interval_us
        if (i > 0 or not is_taken) and not _advance(
            calls, slow_calls, counters, interval_us, plant, sensing, slow, state, time_us, flags, estimate,
            following, imu_log,
        ):  # fmt: skip
            return
        outer_due = (i - outer_in) % divisor == 0
        if outer_due:
            if not guide(outer_calls, outer, i, time_us, state, row):
                counters["waits"] = 1
                return
            control[3][0] = 0.0
        row = rows[row_at + i]
        row_times[row_at + i] = time_us
        _control(calls, control, flies, row, plant[1])
        if outer_due:
            note_outer(outer_calls, outer, time_us, state)
        counters["ticks"] = i + 1
