"""Loop timing of a flight as the ground station heard it: FS_LOOP_TIMING in the telemetry log."""

from __future__ import annotations

from pathlib import Path

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID
from gcs_cli.link.tlog_file import read_messages
from gcs_cli.report.flight_data import LoopTiming, loop_timing


def read_loop_timing(tlog: Path) -> list[LoopTiming]:
    """Return the loop timing reported in a telemetry log; none if there is no such file."""
    if not tlog.exists():
        return []
    return [
        loop_timing(
            message.time_us * 1e-6,
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
        for _, message in read_messages(tlog, frozenset({FS_LOOP_TIMING_ID}))
    ]
