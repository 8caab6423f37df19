"""Loop timing of a flight in lockstep, which the ground station heard and the log does not hold."""

from __future__ import annotations

from pathlib import Path

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID
from flightstack.mavlink.link import Message
from gcs_cli.link.tlog import read_messages
from gcs_cli.report.flight_data import LoopTiming, loop_timing


def read_loop_timing(tlog: Path, start_s: float = 0.0) -> list[LoopTiming]:
    """Return the loop timing in a telemetry log, if there is one; ``start_s`` is the start of the flight log.

    The first vehicle counts, until it reboots: its later flights have logs of their own.
    """
    timings: list[LoopTiming] = []
    vehicle = None
    for _, message in read_messages(tlog, frozenset({FS_LOOP_TIMING_ID})) if tlog.exists() else ():
        source = (message.get_srcSystem(), message.get_srcComponent())
        if source != (vehicle or source):
            continue
        vehicle = source
        timing = _timing(message, start_s)
        if timings and timing.time_s < timings[-1].time_s:
            break
        timings.append(timing)
    return timings


def _timing(message: Message, start_s: float) -> LoopTiming:
    return loop_timing(
        message.time_us * 1e-6 - start_s,
        message.inner_hz,
        (
            message.execution_mean_us,
            message.execution_p99_us,
            message.execution_max_us,
            message.lateness_mean_us,
            message.lateness_p99_us,
            message.lateness_max_us,
        ),
        message.clock,
    )
