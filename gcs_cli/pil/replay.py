"""Open-loop replay: the inputs of the loops in a log, fed to a target. Pure.

Logs and links to targets both carry float32: a flight with the loops in C replays to the last bit.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray, LoopFlags, LoopStatus
from gcs_cli.pil.flight_samples import FlightSamples, Samples, TimeArray
from gcs_cli.pil.signals import BY_NAME

FlagArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

STATE, SETPOINT, TARGET, INPUT_SIZE = slice(0, 13), slice(13, 24), slice(24, 29), 29
OUTPUT_SIZE, STATUS_AT = 32, 31
OUTPUTS = {
    "target_attitude": slice(0, 4),
    "target_thrust": slice(4, 5),
    "reference_attitude": slice(5, 9),
    "reference_rates": slice(9, 12),
    "reference_acceleration": slice(12, 15),
    "thrust": slice(15, 16),
    "torque": slice(16, 19),
    "thrust_achieved": slice(19, 20),
    "torque_achieved": slice(20, 23),
    "rotor_command": slice(23, 23 + MAX_ROTORS),
}
_OF_TARGET = ("target_attitude", "target_thrust")
_SETPOINT_FIELDS = (
    *(f"{name}[{axis}]" for name in ("position", "velocity", "acceleration") for axis in range(3)),
    *("yaw", "yawspeed"),
)
_PROGRESS_STEPS = 200


class Loops(Protocol):
    """Computes steps of the loops; see ``flightstack.firmware.c_loops.LoopExecutor``."""

    def set(self, name: str, value: float) -> None:
        """Change a parameter from the next step on."""

    def run(self, flags: Sequence[int], inputs: FloatArray) -> FloatArray:
        """Compute steps from ``inputs`` (n, 29); return their outputs (n, 32)."""


class UnfitLogError(ValueError):
    """A log lacks data that a replay needs; the text names it."""


class Recording(NamedTuple):
    """The steps of the loops in a flight, in order."""

    time_us: TimeArray
    """Time of each step, (n,)."""
    inputs: FloatArray
    """State (13), setpoint (11) and attitude target (5) of each step, (n, 29)."""
    flags: FlagArray
    """``LoopFlags`` of each step, (n,)."""
    is_outer: np.ndarray[Any, np.dtype[np.bool_]]
    """True for outer ticks, (n,)."""
    changes: Mapping[int, tuple[tuple[str, float], ...]]
    """Parameters that change before the step of that index."""
    tells_targets: bool
    """True if the log marks the attitude targets that were given to the loops. If not, all are given."""


def recording(flight: FlightSamples) -> Recording:
    """Return the inputs of the loops from a log; raise UnfitLogError.

    Position, velocity and setpoint are logged and used at the outer rate, and held in between.
    """
    steps_us = flight.flown_us
    if not len(steps_us):
        raise UnfitLogError("the loops never ran in it: the vehicle stayed on the ground")
    outer, outer_us = _outer_inputs(flight)
    steps_us = _with_outer_ticks(steps_us, outer_us)
    at = np.searchsorted(outer_us, steps_us, side="right") - 1
    if not len(at) or at[0] < 0:
        raise UnfitLogError("it begins without an outer tick")
    inputs = np.empty((len(steps_us), INPUT_SIZE))
    inputs[:] = outer[at]
    for name, columns in (("attitude", slice(6, 10)), ("rates", slice(10, 13))):
        inputs[:, columns] = _of(flight, name, steps_us)
    is_outer = np.isin(steps_us, outer_us)
    flags, tells = _outer_flags(flight)
    step_flags = np.where(is_outer, flags[at], 0)
    step_flags[_begins(flight, steps_us)] |= LoopFlags.RESET
    return Recording(steps_us, inputs, step_flags, is_outer, _changes(flight, steps_us), tells)


def _with_outer_ticks(steps_us: TimeArray, outer_us: TimeArray) -> TimeArray:
    """Leave out the last steps of a truncated log, whose outer ticks are missing."""
    if len(outer_us) < 2:
        raise UnfitLogError("it holds no outer ticks")
    whole: TimeArray = steps_us[steps_us < outer_us[-1] + np.diff(outer_us).min()]
    return whole


def _outer_inputs(flight: FlightSamples) -> tuple[FloatArray, TimeArray]:
    missing = [
        name
        for name in ("position", "velocity", "target_attitude", "target_thrust", "attitude", "rates")
        if name not in flight.signals
    ]
    if missing:
        raise UnfitLogError(f"it does not hold the topic {BY_NAME[missing[0]].topic}")
    setpoint = flight.topics.get("trajectory_setpoint", {})
    if any(name not in setpoint for name in _SETPOINT_FIELDS):
        raise UnfitLogError("it does not hold the topic trajectory_setpoint")
    outer_us = flight.signals["position"].time_us
    inputs = np.zeros((len(outer_us), INPUT_SIZE))
    parts = {"position": slice(0, 3), "velocity": slice(3, 6), "target_attitude": slice(24, 28)}
    for name, columns in {**parts, "target_thrust": slice(28, 29)}.items():
        inputs[:, columns] = _of(flight, name, outer_us)
    if not np.array_equal(setpoint["timestamp"], outer_us):
        raise UnfitLogError("its topics of the outer loop do not belong together")
    inputs[:, SETPOINT] = np.column_stack([setpoint[name] for name in _SETPOINT_FIELDS])
    return inputs, outer_us


def _of(flight: FlightSamples, name: str, times_us: TimeArray) -> FloatArray:
    samples = flight.signals[name]
    at = np.searchsorted(samples.time_us, times_us)
    if (
        len(samples.time_us) == 0
        or at.max() >= len(samples.time_us)
        or np.any(samples.time_us[at] != times_us)
    ):
        raise UnfitLogError(f"samples of {BY_NAME[name].title} are missing")
    return samples.values[at].astype(np.float64)


def _outer_flags(flight: FlightSamples) -> tuple[FlagArray, bool]:
    """Return the attitude targets of the outer ticks, and True if the log marks the given ones."""
    setpoint = flight.topics["vehicle_attitude_setpoint"]
    if "loop_flags" not in setpoint:
        return np.full(len(setpoint["timestamp"]), LoopFlags.SET_TARGET, np.int64), False
    return setpoint["loop_flags"].astype(np.int64), True


def _begins(flight: FlightSamples, steps_us: TimeArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return True for the steps that are the first after the loops were at rest."""
    times_us, status = flight.status.time_us, flight.status.values[:, 0].astype(np.int64)
    at = np.searchsorted(times_us, steps_us)
    rests = (status & LoopStatus.IDLE) != 0
    return np.where(at > 0, rests[np.maximum(at, 1) - 1], True)


def _changes(flight: FlightSamples, steps_us: TimeArray) -> dict[int, tuple[tuple[str, float], ...]]:
    """A change is logged after the samples of its time, and effective in the next step."""
    found: dict[int, tuple[tuple[str, float], ...]] = {}
    for at_us, name, value in flight.changes:
        index = int(np.searchsorted(steps_us, at_us, side="right"))
        if index < len(steps_us):
            found[index] = (*found.get(index, ()), (name, value))
    return found


def replayed(
    record: Recording, loops: Loops, known: Callable[[str], bool], progress: Callable[[int, int], None]
) -> FloatArray:
    """Feed all steps to ``loops`` and return their outputs, (n, 32).

    ``known`` has the parameters of the loops. ``progress`` is called with the number of completed steps and the total.
    """
    count = len(record.time_us)
    outputs = np.empty((count, OUTPUT_SIZE))
    flags = record.flags.tolist()
    begins = sorted({*range(0, count, _PROGRESS_STEPS), *(at for at in record.changes if at < count)})
    for begin, end in itertools.pairwise((*begins, count)):
        for name, value in record.changes.get(begin, ()):
            if known(name):
                loops.set(name, value)
        outputs[begin:end] = loops.run(flags[begin:end], record.inputs[begin:end])
        progress(end, count)
    return outputs


def as_flight(record: Recording, outputs: FloatArray, info: Mapping[str, Any]) -> FlightSamples:
    """Return the outputs in the form of a log with this ``info``, for comparison with others.

    The attitude target is that of the outer ticks. If the log does not mark those of the outer loop, all were given,
    and none is compared.
    """
    signals = {
        name: Samples(record.time_us, outputs[:, columns].astype(np.float32))
        for name, columns in OUTPUTS.items()
    }
    aims = record.is_outer & ((record.flags & LoopFlags.OUTER_DUE) != 0)
    for name in _OF_TARGET:
        samples = signals.pop(name)
        if record.tells_targets:
            signals[name] = Samples(samples.time_us[aims], samples.values[aims])
    status = Samples(record.time_us, outputs[:, STATUS_AT:].astype(np.float32))
    return FlightSamples(signals, status, {}, info, {}, ())
