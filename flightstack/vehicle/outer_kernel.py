"""A nominal outer tick as compiled code, for the kernel of quiet ticks.

In flight it runs failsafe detectors, guidance and outer loop, on the ground the detectors, and what of the others goes
on there: see the phases.

It calls the kernels that monitor, guidance and loops run in any other tick, on the same arrays and in the same order.
If one of them finds an event, such as a breached fence, a reached mission item or ground contact, it puts their
memories back as they were: the tick is then run in Python, which knows what follows from the event.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.commander.fault_detector import MOVING
from flightstack.commander.ground_monitor import FALL_M_S, STANDING_M_S
from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.kernels.calls import call_kernel, call_kernel_int
from flightstack.core.record_types import dtype_of
from flightstack.guidance.land_detector import CONTACT_M_S, REST_M_S

STANDS, FLIES, LEVELS, RESTS, LIFTS = range(5)
"""Phases of nominal outer ticks: on the ground with stopped loops; in the air; in ground contact with little thrust;
after it, with stopped loops, until the vehicle counts as landed; landed with loops that run, before it lifts off."""


class OuterCalls(NamedTuple):
    """Addresses of the kernels."""

    fence: int
    detect: int
    guide: int
    command: int
    level: int
    store: int


class OuterMarks(NamedTuple):
    """What the kernel notes."""

    at: int
    """Index of the first row of the log."""
    outers: int
    """Number of outer ticks."""
    last: int
    """Index of the last one among all ticks."""
    fell_us: int
    """Time of the last fall, or 0."""
    changed_us: int
    """Time of the last outer tick whose state was new, or 0."""
    found: int
    """Bits of ``detect``, as before if it was not called."""


class Progress(NamedTuple):
    """Items of the mission, by their index."""

    current: int
    reached: int


OUTER_CALLS, OUTER_MARKS, PROGRESS = dtype_of(OuterCalls), dtype_of(OuterMarks), dtype_of(Progress)


@compiled
def _are_equal(left: Any, right: Any) -> bool:
    for i in range(len(left)):  # noqa: SIM110  # compiled code has no ``all``
        if left[i] != right[i]:
            return False
    return True


@compiled
def _phase_of(land: FloatArray) -> int:
    """Return the phase of a vehicle whose loops were started, by the memory of the land detector."""
    if land[0] > 0.0:
        return LIFTS
    if land[1] < CONTACT_M_S:
        return FLIES
    return LEVELS if land[1] < REST_M_S else RESTS


@compiled
def _has_progress(mission: Any, progress: Any) -> bool:
    """Return True if the mission has reached an item since ``progress``, or is at its end."""
    m = mission[0]
    is_over = m["finished"] or m["wants_return"]
    return bool(is_over or m["current"] != progress[0]["current"] or m["reached"] != progress[0]["reached"])


@compiled
def _leaves_fence(calls: Any, fence: Any, state: FloatArray) -> bool:
    is_active, areas, vertices, groups, limits, breach = fence
    if not is_active:
        return False
    call_kernel(calls["fence"], (areas, vertices, groups, limits, state, breach))
    return bool(breach[0]["flags"] != 0)


@compiled
def _is_nominal(calls: Any, outer: Any, state: FloatArray, row: FloatArray) -> bool:
    """Advance fence, detectors and guidance; return False after an event, when memories may have changed."""
    marks, watch, fence, faults, guidance, control, _log, _saved = outer
    _state_bytes, _seen, altitude_m, acceptance_m, is_mission, progress, phase, _is_armed = watch
    number, trajectory, mission, plan, jumps_left, mode_target, land, params, dt_s, setpoint = guidance
    rotors, detectors, limits = faults
    if _phase_of(land) != phase or (is_mission and _has_progress(mission, progress)):
        return False
    if abs(state[2] + altitude_m) <= acceptance_m or _leaves_fence(calls, fence, state):
        return False
    on_ground = phase != FLIES
    place = setpoint if phase in (FLIES, LIFTS) else state  # the position is not controlled
    found = call_kernel_int(calls["detect"], (state, place, row, rotors, detectors, limits, on_ground, dt_s))
    if found & ~MOVING != 0:
        return False
    call_kernel(
        calls["guide"],
        (
            number, state, trajectory, mission, plan, jumps_left, mode_target, land, control[0], rotors[0]["thrust"],
            params, dt_s, setpoint,
        ),
    )  # fmt: skip
    if _phase_of(land) != phase:
        return False
    marks[0]["found"] = found
    return True


@compiled
def _command(calls: Any, phase: int, state: FloatArray, setpoint: FloatArray, control: Any) -> None:
    """Write the attitude target."""
    target, last_target, memory, parameters, last, outer_dt_s, thrust_n, levelled = control
    if phase == RESTS:  # as a reset of the loops
        copy_all(state[6:10], target)
        target[4] = 0.0
        copy_all(target, last_target)
        return
    copy_all(target, last_target)
    if phase == LEVELS:
        call_kernel(calls["level"], (last_target, thrust_n, levelled, target))
    else:
        call_kernel(calls["command"], (state, setpoint, memory, parameters, last, outer_dt_s, target))


@compiled
def _stands(calls: Any, outer: Any, state: FloatArray, row: FloatArray) -> bool:
    """Advance fence and detectors of a vehicle on the ground, without a target; return False after an event."""
    marks, watch, fence, faults, guidance, _control, _log, _saved = outer
    if abs(state[5]) > STANDING_M_S or _leaves_fence(calls, fence, state):
        return False
    is_armed = watch[7]
    if is_armed:
        rotors, detectors, limits = faults
        on_ground, dt_s = True, guidance[8]
        place = state  # as setpoint: the position is not controlled
        found = call_kernel_int(
            calls["detect"], (state, place, row, rotors, detectors, limits, on_ground, dt_s)
        )
        if found & ~MOVING != 0:
            return False
        marks[0]["found"] = found
    return True


@compiled
def guide(calls: Any, outer: Any, tick: int, time_us: int, state: FloatArray, row: FloatArray) -> bool:
    """Run the outer tick ``tick`` up to the outer loop; return False, with nothing changed, if it is not nominal.

    ``row`` is the newest row of the inner loop.
    """
    marks, watch, _fence, _faults, guidance, control, _log, saved = outer
    phase, is_armed = watch[6], watch[7]
    memories, copies = saved
    is_new = not _are_equal(watch[0], watch[1])
    if is_armed and not is_new:
        return False
    for k in range(len(memories)):
        copy_all(memories[k], copies[k])
    stands = phase == STANDS
    if not (_stands(calls, outer, state, row) if stands else _is_nominal(calls, outer, state, row)):
        for k in range(len(memories)):
            copy_all(copies[k], memories[k])
        return False
    if is_new:
        copy_all(watch[0], watch[1])
        marks[0]["changed_us"] = time_us
    marks[0]["last"] = tick
    if not stands:
        if abs(state[5]) > FALL_M_S:
            marks[0]["fell_us"] = time_us
        _command(calls, phase, state, guidance[9], control)
    return True


@compiled
def note_outer(calls: Any, outer: Any, time_us: int, state: FloatArray) -> None:
    """Record the outer tick, after its inner loop."""
    marks_array, _watch, _fence, _faults, guidance, control, log, _saved = outer
    marks = marks_array[0]
    rows, times_us, size, estimate, flags = log
    at = marks["at"] + marks["outers"]
    row = rows[at]
    times_us[at] = time_us
    call_kernel(calls["store"], (row, state, guidance[9], control[0], flags))
    for i in range(len(estimate)):
        row[size + i] = estimate[i]
    marks["outers"] += 1
