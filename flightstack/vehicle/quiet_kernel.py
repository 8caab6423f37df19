"""Quiet ticks as one compiled call: simulator, filter, inner loop, rotor monitor, nominal outer ticks.

It calls the kernels that each part runs in any other tick, at their addresses, on the same arrays and in the same
order. That of the simulator computes its step, or exchanges commands and state with another process. Records are passed
as bytes, so that this kernel is compiled once for all of them. A module of its own, with few imports: the key of a
kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, LoopRow
from flightstack.core.kernels.calls import call_kernel, call_kernel_int
from flightstack.core.record_types import dtype_of
from flightstack.vehicle.outer_kernel import guide, note_outer
from flightstack.vehicle.slow_kernel import log_estimate, log_truth, take_fix, take_slow, watch_health

_REFERENCE, _COMMAND, _SPEED = (
    columns.start for columns in (LoopRow.REFERENCE_ATTITUDE, LoopRow.ROTOR_COMMAND, LoopRow.ROTOR_SPEED)
)


class QuietCalls(NamedTuple):
    """Addresses of the kernels; those of the sensors are 0 on the true state."""

    step: int
    """Takes ``world``, the simulator's time and the flags of the commands; returns a result, below 0 without a step."""
    control: int
    follow: int
    take: int
    estimate: int
    push: int
    watch: int
    local_position: int
    estimator: int


class QuietCounters(NamedTuple):
    """What the kernel did."""

    ticks: int
    """Of the vehicle."""
    flown: int
    """Steps of the simulator."""
    result: int
    """Of the last step."""
    sensed: int
    """Samples of the inertial sensors."""
    waits: int
    """1 if a tick is begun that must be run in Python."""


LARGEST_RESULT = 1
"""Of a step that ticks follow: a plant that touches the ground. Above it the plant has diverged."""
PAUSES = 4
"""Further bit of the result of a step after which the tick waits."""
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
    """Give each filter the sample of its inertial sensor; ``record`` takes that of the selected one.

    ``sensing`` has records as bytes, with an element for each sensor, none on the true state.
    """
    wires, tracks, rings, filters, spare_record = sensing
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
    calls: Any, counters: Any, interval_us: int, world: Any, sensing: Any, slow: Any,
    state: FloatArray, time_us: int, boot_us: int, flags: int, estimate: Any, following: Any, imu_log: Any,
) -> bool:  # fmt: skip
    """Advance simulator and estimate to ``time_us``; return False if no tick is to follow.

    The tick waits after a reset of the estimate, when the conditions of its health change, and after a report of the
    battery that the vehicle may act on. ``slow`` and ``following`` are as in ``slow_kernel``.
    """
    selected, known, is_known, resets = estimate
    records, record_times, record_at = imu_log
    result = call_kernel_int(calls["step"], (world, time_us + boot_us, flags))
    if result < 0:
        return False
    pauses = result & PAUSES != 0
    result &= ~PAUSES
    counters["flown"] += 1
    counters["result"] = result
    if result > LARGEST_RESULT:
        return False
    if len(sensing[0]) > 0:
        resets_before = _total(resets)
        at = record_at + counters["sensed"]
        record_times[at] = time_us
        take_fix(calls["push"], slow, time_us, sensing[3], following)
        _sense(calls, sensing, time_us, interval_us, selected, records[at])
        take_slow(calls["push"], slow, time_us, sensing[3], following)
        counters["sensed"] += 1
        if is_known[0] != 0:
            copy_all(known, state)
        log_truth(slow, time_us, following)
        first = sensing[3][0], sensing[1][0]
        log_estimate(calls, slow, time_us, first, following)
        has_reset = _total(resets) != resets_before
        pauses = has_reset or not watch_health(calls["watch"], slow, time_us, first, following) or pauses
    if pauses:
        counters["waits"] = 1
    return not pauses


@compiled
def _begin(counters: Any, marks: Any) -> None:
    counters["ticks"], counters["flown"], counters["result"] = 0, 0, 0
    counters["sensed"], counters["waits"] = 0, 0
    marks["outers"], marks["fell_us"], marks["changed_us"] = 0, 0, 0


@compiled
def fly_quiet_ticks(
    calls_of: Any, counters_array: Any, interval_us: int, divisor: int, world: Any, commands: FloatArray,
    sensing: Any, slow: Any, control: Any, count: int, is_taken: bool, outer_in: int, time_us: int,
    boot_us: int, flags: int, flies: bool, last_row: FloatArray, estimate: Any, following: Any, outer: Any,
    log: Any, imu_log: Any,
) -> None:  # fmt: skip
    """Run ``count`` ticks, or fewer: what was done is in ``counters_array``, ``marks`` and ``slow``.

    The state of the first tick ``is_taken``, or the simulator advances to it with ``commands``; its time is that of
    the vehicle and ``boot_us``.
    The first outer tick is that after ``outer_in`` ticks. It stops without a step of the simulator, when its result is
    above ``LARGEST_RESULT``, and when the tick waits: see ``_advance`` and ``guide``; for ``sensing`` ``_sense``.
    """
    rows, row_times, row_at = log
    calls, outer_calls = calls_of[0][0], calls_of[1][0]
    state, row, counters, marks = control[0], last_row, counters_array[0], outer[0][0]
    _begin(counters, marks)
    for i in range(count):
        time_us += interval_us
        if (i > 0 or not is_taken) and not _advance(
            calls, counters, interval_us, world, sensing, slow, state, time_us, boot_us, flags, estimate, following,
            imu_log,
        ):  # fmt: skip
            return
        outer_due = (i - outer_in) % divisor == 0
        if outer_due:
            if not guide(outer_calls, outer, i, time_us, state, row):
                counters["waits"] = 1
                return
            if flies:
                control[3][0] = 0.0
        row = rows[row_at + i]
        row_times[row_at + i] = time_us
        _control(calls, control, flies, row, commands)
        if outer_due:
            note_outer(outer_calls, outer, time_us, state)
        counters["ticks"] = i + 1
