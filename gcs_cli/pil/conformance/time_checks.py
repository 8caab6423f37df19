"""Checks of a target's clocks: milliseconds, heartbeats, the cost counter."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

from flightstack.firmware.pil_record import COST_UNITS
from flightstack.firmware.pil_steps import PilReport
from gcs_cli.pil.conformance.check import FAILED, NOT_CHECKED, Check, judged
from gcs_cli.pil.conformance.line import Line, status_of

WATCHED_S = 3.2
SAMPLES = 8
LARGEST_RATE_ERROR = 0.02
"""An internal oscillator is within 1 % at room temperature."""
LARGEST_COST_S = 0.02
"""Longer steps are slower than any board that the firmware fits on."""


class _Sample(NamedTuple):
    host_s: float
    """Middle of the exchange."""
    width_s: float
    target_ms: int


def time_base(line: Line) -> list[Check]:
    """Compare the target's milliseconds with this machine's clock, and count its heartbeats."""
    samples, beats, began_s = list[_Sample](), 0, line.now_s
    for _ in range(SAMPLES + 1):
        sent_s = line.now_s
        status = line.request("FS_PIL_STATUS")
        if status is not None:
            now_s = line.now_s
            samples.append(_Sample((sent_s + now_s) / 2.0, now_s - sent_s, status_of(status)["time_boot_ms"]))
        beats += sum(message.get_type() == "HEARTBEAT" for _, message in line.wait(WATCHED_S / SAMPLES))
    return [_milliseconds(samples), _heartbeats(beats, line.now_s - began_s)]


def _milliseconds(samples: list[_Sample]) -> Check:
    name, advice = "time base", "Check the clock and the divider of the timer that counts milliseconds."
    if len(samples) < 2:
        return Check(name, FAILED, "the target does not answer requests for FS_PIL_STATUS", advice)
    times = [sample.target_ms for sample in samples]
    first, last = samples[0], samples[-1]
    if any(later < earlier for earlier, later in itertools.pairwise(times)):
        return Check(name, FAILED, f"the target's milliseconds run backwards: {times}", advice)
    span_s = last.host_s - first.host_s
    rate = (last.target_ms - first.target_ms) / 1e3 / span_s
    uncertainty = ((first.width_s + last.width_s) / 2.0 + 0.002) / span_s
    return judged(
        name,
        abs(rate - 1.0) <= LARGEST_RATE_ERROR + uncertainty,
        f"the target's clock runs at {rate:.3f} of this machine's, ± {uncertainty:.3f}",
        f"{advice} Its rate must be right within {LARGEST_RATE_ERROR:.0%}.",
    )


def _heartbeats(beats: int, duration_s: float) -> Check:
    return judged(
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
    return judged(
        name,
        max(whole) <= limit,
        found if not hz else f"{found}, {max(whole) / hz * 1e6:.1f} us at most",
        "A step cannot take that long: the counter must count up (complement one that counts down), by 32 bits, and "
        "clock_hz must be the rate at which it counts.",
    )
