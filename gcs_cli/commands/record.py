"""``gcs record``: all messages of a link, both ways, in a telemetry log."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.tlog import TlogFile
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.vehicle_link import DurationOption, connect_vehicle, follow

app = make_app(add_completion=False)


@app.command()
@expand_options
def record(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[Path, typer.Argument(metavar="FILE.tlog")],
    duration: DurationOption = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Record all messages of the link until Ctrl-C.

    The telemetry log holds both directions, those of other ground stations that share this link too. It is readable
    while it grows; QGroundControl, MAVProxy and `gcs --connect FILE.tlog` play it.
    """
    output = output_of(context, link)
    if file.suffix.lower() != ".tlog":
        raise CliError(f"record: {file}: the name of a telemetry log ends with .tlog", USAGE)
    check_new(file, overwrite)
    recorder = _Recorder()
    with connect_vehicle(context, link, shares=True, several=True, record=recorder.take) as connection:
        began_s = connection.now_s
        # from the first frame on Ctrl-C ends the recording in order
        with _opened(file, overwrite) as tlog, contextlib.suppress(KeyboardInterrupt):
            recorder.begin(tlog)
            follow(connection, duration, lambda: tlog.error is not None)
        seconds = connection.now_s - began_s
    if tlog.error is not None:
        raise CliError(f"record: {file} ends early: {tlog.error.strerror or tlog.error}")
    output.say(
        "recorded",
        f"{recorder.count} messages in {seconds:.1f} s recorded in {file}",
        file=str(file),
        messages=recorder.count,
        duration_s=round(seconds, 3),
    )


class _Recorder:
    """Takes frames with their time, and writes them once there is a file."""

    def __init__(self) -> None:
        self._early: list[tuple[int, bytes]] = []
        self._tlog: TlogFile | None = None
        self.count = 0

    def take(self, frame: bytes) -> None:
        """Take a frame that is sent or received now."""
        time_us = time.time_ns() // 1000
        if self._tlog is None:
            self._early.append((time_us, frame))
        else:
            self._write(time_us, frame)

    def begin(self, tlog: TlogFile) -> None:
        """Write the frames taken so far, and all later ones."""
        self._tlog = tlog
        for time_us, frame in self._early:
            self._write(time_us, frame)
        self._early.clear()

    def _write(self, time_us: int, frame: bytes) -> None:
        assert self._tlog is not None
        if not self._tlog.is_closed:
            self._tlog.write(time_us, frame)
            self.count += 1


def _opened(path: Path, overwrite: bool) -> TlogFile:
    """Return the new log; an existing one is replaced only once the new one can be written."""
    temporary = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        tlog = TlogFile(temporary)
        check_new(path, overwrite)
        temporary.replace(path)
    except OSError as error:
        raise CliError(f"record: {path}: cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)
    return tlog
