"""Checks of a target's clocks: milliseconds, heartbeats, the cost counter."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

from flightstack.firmware.pil.record import COST_UNITS
from flightstack.firmware.pil.steps import PilReport
from gcs_cli.pil.conformance.check import FAILED, NOT_CHECKED, Check, check_of
from gcs_cli.pil.conformance.line import Line, status_of

WATCHED_S = 3.2
SAMPLES = 8
LARGEST_RATE_ERROR = 0.02
"""An internal oscillator is within 1 % at room temperature."""
LARGEST_START_S = 0.1
"""Limit for the time between the starts of milliseconds and microseconds."""
NO_STATUS = "the target does not answer requests for FS_PIL_STATUS"
LARGEST_COST_S = 0.02
"""Longer steps are slower than any board that the firmware fits on."""


class Sample(NamedTuple):
    """A reading of the target's clocks."""

    host_s: float
    """Middle of the exchange."""
    width_s: float
    target_ms: int
    target_us: int


def time_base(line: Line) -> list[Check]:
    """Compare the target's milliseconds with this machine's clock, and count its heartbeats."""
    samples, beats, began_s = list[Sample](), line.heartbeats, line.now_s
    for _ in range(SAMPLES + 1):
        sent_s = line.now_s
        status = line.request("FS_PIL_STATUS")
        if status is not None:
            now_s = line.now_s
            read = status_of(status)
            times = read["time_boot_ms"], read["time_us"]
            samples.append(Sample((sent_s + now_s) / 2.0, now_s - sent_s, *times))
        line.wait(WATCHED_S / SAMPLES)
    return [
        _milliseconds(samples),
        microseconds(samples),
        _heartbeats(line.heartbeats - beats, line.now_s - began_s),
    ]


def _milliseconds(samples: list[Sample]) -> Check:
    name, advice = "time base", "Check the clock and the divider of the timer that counts milliseconds."
    if len(samples) < 2:
        return Check(name, FAILED, NO_STATUS, advice)
    times = [sample.target_ms for sample in samples]
    if any(later < earlier for earlier, later in itertools.pairwise(times)):
        return Check(name, FAILED, f"the target's milliseconds run backwards: {times}", advice)
    is_right, found = _rate(samples, (times[-1] - times[0]) / 1e3)
    return check_of(
        name, is_right, found, f"{advice} Its rate must be right within {LARGEST_RATE_ERROR:.0%}."
    )


def _rate(samples: list[Sample], passed_s: float) -> tuple[bool, str]:
    """Return whether a clock of the target, on which ``passed_s`` passed, has the right rate, and the finding."""
    first, last = samples[0], samples[-1]
    span_s = last.host_s - first.host_s
    rate = passed_s / span_s
    uncertainty = ((first.width_s + last.width_s) / 2.0 + 0.002) / span_s
    found = f"the target's clock runs at {rate:.3f} of this machine's, ± {uncertainty:.3f}"
    return abs(rate - 1.0) <= LARGEST_RATE_ERROR + uncertainty, found


def microseconds(samples: list[Sample]) -> Check:
    """Compare the target's microseconds with this machine's clock and with its milliseconds, which wrap later."""
    name = "microseconds"
    advice = (
        "fs_board_now_us counts up from the start modulo 2^32, in steps of a millisecond at most. A counter of cycles "
        "wraps too early if it is divided: sum up its differences."
    )
    if len(samples) < 2:
        return Check(name, FAILED, NO_STATUS, advice)
    if not any(sample.target_us for sample in samples):
        return Check(
            name, NOT_CHECKED, "the target has no microseconds", "It refuses free-running without them."
        )
    times = [sample.target_us for sample in samples]
    steps = [_signed(later - earlier) for earlier, later in itertools.pairwise(times)]
    if min(steps) < 0:
        return Check(name, FAILED, f"the target's microseconds run backwards: {times}", advice)
    is_right, found = _rate(samples, sum(steps) / 1e6)
    uptime_s = samples[-1].target_ms / 1e3
    apart_s = abs(_signed(times[-1] - 1000 * samples[-1].target_ms)) / 1e6
    if is_right and apart_s > LARGEST_START_S + 2.0 * LARGEST_RATE_ERROR * uptime_s:
        found = f"they are {apart_s:.3f} s apart from the milliseconds, {uptime_s:.0f} s after the start"
        return Check(name, FAILED, found, advice)
    return check_of(name, is_right, found, advice)


def _signed(difference_us: int) -> int:
    """Return a difference modulo 2^32 as the number next to zero."""
    return (difference_us + 2**31) % 2**32 - 2**31


def _heartbeats(beats: int, duration_s: float) -> Check:
    return check_of(
        "heartbeats",
        abs(beats - duration_s) <= 1.5,
        f"{beats} heartbeats in {duration_s:.1f} s, one a second is due",
        "Call fs_app_poll with the millisecond counter in every pass of the main loop, also if nothing was received.",
    )


def cost_counter(identity: Any, reports: list[PilReport]) -> Check:
    """Check that each step costs something, and not more than is plausible."""
    name = "cost counter"
    unit = COST_UNITS[identity.cost_unit] if identity.cost_unit < len(COST_UNITS) else "?"
    whole = [report.cost[3] for report in reports]
    if identity.cost_unit == 0:
        return Check(
            name, NOT_CHECKED, "the target measures no cost", "Give fs_port a clock to see what a step costs."
        )
    if not whole:
        return Check(name, FAILED, "no step was computed", "See the other checks.")
    found = f"a step costs {min(whole)} to {max(whole)} {unit}"
    if min(whole) == 0:
        return Check(
            name,
            FAILED,
            found,
            "The counter stands still: start it, and let fs_port.clock count up modulo 2^32.",
        )
    hz = {"cycles": identity.clock_hz, "ns": 1_000_000_000}.get(unit, 0)
    if unit == "cycles" and not hz:
        return Check(name, FAILED, found, "Set fs_port.clock_hz, without which cycles are no time.")
    limit = hz * LARGEST_COST_S if hz else float(1 << 31)
    return check_of(
        name,
        max(whole) <= limit,
        found if not hz else f"{found}, {max(whole) / hz * 1e6:.1f} us at most",
        "A step cannot take that long: the counter must count up (complement one that counts down), by 32 bits, and "
        "clock_hz must be the rate at which it counts.",
    )
