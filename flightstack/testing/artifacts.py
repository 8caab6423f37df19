"""What is kept of a failed flight: flight log, telemetry log and report, and the text that describes it."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from flightstack.core.atomic_file import write_bytes_atomically
from flightstack.core.errors import ConfigError
from flightstack.testing.flight import Flight
from flightstack.testing.setup import Setup
from flightstack.testing.world import World
from gcs_cli.link.tlog import encode_record
from gcs_cli.report.page import write_report
from gcs_cli.report.summary import RunInfo, summarise
from gcs_cli.run_directory import LOG_NAME, REPORT_NAME, TLOG_NAME

_TEXTS = 5
"""Number of status texts that are shown."""
_LONGEST_NAME = 80
_HIDDEN = ("folder", "seed")


def setup_text(setup: Setup) -> str:
    """Return the call that makes the world of ``setup``.

    >>> setup_text(Setup(vehicle="x_quad", wind=(5.0, 0.0), seed=3))
    "sitl(vehicle='x_quad', wind=(5.0, 0.0), seed=3)"
    """
    given = {name: value for name, value in setup.changed().items() if name not in _HIDDEN}
    return f"sitl({', '.join(f'{name}={value!r}' for name, value in {**given, 'seed': setup.seed}.items())})"


class Evidence(NamedTuple):
    """What a failed test leaves: its newest flight, its telemetry log, and the lines that describe it."""

    flight: Flight | None
    tlog: bytes
    lines: list[str]


class Flown:
    """A world of a test, the frames of its ground station, and its flight."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.flight: Flight | None = None
        """The flight of ``sitl.fly``; None if the test flies the world itself."""
        self._records: list[bytes] = []
        world.gcs.session.record = self._record

    def _record(self, frame: bytes) -> None:
        self._records.append(encode_record(round(self.world.time_s * 1e6), frame))

    def evidence(self) -> Evidence:
        """Return flight, telemetry in simulated time, and state, last texts, seed and setup."""
        world, flight = self.world, self.flight
        if flight is None and world.engine.newest_log():  # armed once; the flight may not be over
            flight = world.flight()
        return Evidence(
            flight, b"".join(self._records), description(str(world.state), world.texts, world.setup)
        )


def description(state: str, texts: Sequence[str], setup: Setup) -> list[str]:
    """Return the lines that describe a flight in a report."""
    shown = [f"{'' if index else 'texts:':8} {text}" for index, text in enumerate(texts[-_TEXTS:])]
    return [f"state:   {state}", *shown, f"seed:    {setup.seed}", f"setup:   {setup_text(setup)}"]


@dataclass
class Kept:
    """The files that were written for a failed test."""

    lines: list[str]
    properties: list[tuple[str, object]] = field(default_factory=list)
    """Name and path of each file, for the reports of other tools."""


class Artifacts:
    """Writes the files of failed tests, a folder for each test."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def folder(self, nodeid: str) -> Path:
        """Return the folder of a test: its name is unique and valid on every file system."""
        digest = hashlib.sha256(nodeid.encode()).hexdigest()[:8]
        name = re.sub(r"[^\w.=-]+", "-", nodeid, flags=re.ASCII).strip("-.")
        return self._folder / f"{name[-_LONGEST_NAME:].lstrip('-.')}-{digest}"

    def keep(self, nodeid: str, evidence: Evidence, reason: str) -> Kept:
        """Write flight log, telemetry log and report; an error is a line of the result."""
        try:
            return _written(self.folder(nodeid), evidence, reason)
        except (OSError, ConfigError) as error:
            return Kept([f"files:   none: {error}"])


_KINDS = {LOG_NAME: "log", TLOG_NAME: "tlog", REPORT_NAME: "report"}


def _written(folder: Path, evidence: Evidence, reason: str) -> Kept:
    folder.mkdir(parents=True, exist_ok=True)
    for name in _KINDS:
        (folder / name).unlink(missing_ok=True)  # of an earlier run
    flight, log, tlog = evidence.flight, folder / LOG_NAME, folder / TLOG_NAME
    if evidence.tlog:
        write_bytes_atomically(tlog, evidence.tlog, survives_power_loss=False)
    if flight is not None and flight.log.content:
        write_bytes_atomically(log, flight.log.content, survives_power_loss=False)
        summary = summarise(flight.data, flight.plan, run_info(flight, folder.name, reason, log))
        write_report(folder / REPORT_NAME, flight.data, flight.plan, summary, tlog)
    paths = [path for name in _KINDS if (path := folder / name).exists()]
    lines = [f"{'' if index else 'files:':8} {path}" for index, path in enumerate(paths)]
    return Kept(lines, [(f"flightstack_{_KINDS[path.name]}", str(path)) for path in paths])


def run_info(flight: Flight, name: str, reason: str, log: Path) -> RunInfo:
    """Return the conditions of a flight for its summary."""
    setup = flight.setup

    def numbers(values: Sequence[float]) -> str | None:
        return ",".join(f"{value:g}" for value in values) if any(values) else None

    return RunInfo(
        outcome=flight.outcome or "incomplete",
        outcome_text=flight.outcome_text or reason,
        plan=name,
        vehicle=setup.vehicle,
        controller=setup.controller,
        gains=setup.gains,
        plant=setup.plant,
        loops=setup.loops,
        state=setup.state,
        seed=setup.seed,
        wind=numbers(setup.wind),
        gust=setup.gust or None,
        torque_gust=setup.torque_gust or None,
        force=numbers(setup.force),
        torque=numbers(setup.torque),
        slope=setup.slope_deg or None,
        boat=numbers(setup.boat),
        battery_start=setup.battery_percent,
        battery_capacity=setup.battery_capacity_mah,
        battery_drain=setup.battery_drain,
        ideal_rotors=setup.ideal_rotors,
        faults=tuple(f"at {event.time_s:.2f} s" for event in flight.caused if event.name == "fault"),
        param=tuple(f"{key}={value:g}" for key, value in setup.params.items()),
        inner_hz=setup.inner_hz,
        log_path=log,
    )


def repeat_command(nodeid: str, rootpath: Path, directory: Path) -> str:
    """Return the command that repeats one test from the directory in which pytest was started.

    >>> repeat_command("tests/test_wind.py::test_lands[5 m/s]", Path("/project"), Path("/project/tests"))
    "pytest 'test_wind.py::test_lands[5 m/s]'"
    """
    file, separator, rest = nodeid.partition("::")
    return f"pytest {shlex.quote(os.path.relpath(rootpath / file, directory) + separator + rest)}"
