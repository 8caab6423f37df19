"""A whole flight of ``gcs fly``: ports, directory, processes, mission."""

from __future__ import annotations

import contextlib
import importlib
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from flightstack.core.port_numbers import vehicle_ground_port
from flightstack.plan import Plan
from flightstack.process.console import complain
from flightstack.process.supervised import PreparedPrograms
from gcs_cli.errors import FAILED, INTERRUPTED, NO_ANSWER, USAGE, CliError
from gcs_cli.fly.flight import Flight, Flown, Phase
from gcs_cli.fly.flight_watch import STALL_S
from gcs_cli.fly.fly_display import Display, FlyConsole, make_display
from gcs_cli.fly.fly_flags import FlyOptions, RunOptions
from gcs_cli.fly.fly_options import (
    check_ports,
    checked_plan,
    home_of,
    longest_flight_s,
    simulator_arguments,
    stack_arguments,
)
from gcs_cli.fly.processes import Child, Children, Interruption
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import LOOPBACK, UDP_IN, VehicleEndpoint
from gcs_cli.link.tlog import TlogFile
from gcs_cli.output import show_page
from gcs_cli.report.flight_outcome import Code, Outcome
from gcs_cli.run_directory import (
    REPORT_NAME,
    RUNS,
    SIMULATOR,
    STACK,
    TLOG_NAME,
    make_run_directory,
    new_folders,
    remove_run,
)
from gcs_cli.vehicle_link import open_signing

_STEP_S = 0.1
_END_TIMEOUT_S = 10.0
_RESULTS = "gcs_cli.fly.fly_results"


def fly(
    options: FlyOptions,
    plan: Plan,
    out: Path | None,
    display: Display,
    overwrite: bool = False,
    prepared: PreparedPrograms | None = None,
) -> Flown:
    """Fly ``plan`` with a simulator and a flight stack of our own; raise CliError if they cannot be started.

    Nothing is left behind if one of them refuses its options, such as a controller that does not compile.
    The vehicle sends to a port of our own, so that another ground station may use the default one.
    """
    vehicle = (LOOPBACK, vehicle_ground_port(options.instance))
    own_port = VehicleEndpoint(UDP_IN, LOOPBACK, 0)
    signing = open_signing(options.signing_key)
    with Interruption() as interruption, Connection(own_port, signing=signing, vehicle=vehicle) as connection:
        check_ports(options)
        new = new_folders(RUNS if out is None else out)
        folder = make_run_directory(options.plan_path, out, overwrite=overwrite)
        flight = Flight(
            connection.session,
            plan,
            connection.now_s,
            options.timeout_s,
            longest_flight_s(options, plan),
            STALL_S / min(1.0, options.speed_factor),
        )
        with _recording(connection, folder), Children(folder, prepared) as children:
            home = home_of(options, plan)
            children.start(SIMULATOR, "sim_bridge", simulator_arguments(options, home))
            children.start(
                STACK, "flightstack", stack_arguments(options, home, folder, connection.local_port)
            )
            run_flight(flight, connection, children, interruption, display)
            if flight.shut_down_accepted:
                children.wait(_END_TIMEOUT_S)
            _show_notices(children, display)
    return _flown(flight, folder, new if out is not None else [folder, *new])


def _flown(flight: Flight, folder: Path, new: list[Path]) -> Flown:
    """Return the result; remove the ``new`` folders of options that were refused, and raise CliError."""
    outcome, wall_time_s = flight.outcome, None
    assert outcome is not None
    if flight.began_s is None and outcome.exit_code == USAGE:
        remove_run(folder, new)
        raise CliError(outcome.reason, USAGE)
    if flight.began_s is not None and flight.ended_s is not None:
        wall_time_s = flight.ended_s - flight.began_s
    timing = flight.view.timing
    overruns = None if timing is None else timing.overruns
    return Flown(folder, outcome, wall_time_s, overruns, flight.returned_by_us)


@contextlib.contextmanager
def _recording(connection: Connection, folder: Path) -> Iterator[None]:
    """Record the session's frames in the directory of the flight."""
    with TlogFile(folder / TLOG_NAME) as tlog:
        connection.session.record = lambda frame: tlog.write(time.time_ns() // 1000, frame)
        try:
            yield
        finally:
            connection.session.record = None
            if tlog.error is not None:
                reason = tlog.error.strerror or tlog.error
                complain(f"gcs: the telemetry log {folder / TLOG_NAME} ends early: {reason}")


def run_flight(
    flight: Flight, connection: Connection, children: Children, interruption: Interruption, display: Display
) -> None:
    """Exchange messages, watch the children and draw until the flight is over."""
    # 0.2 s, which is long for the vehicle in simulated time: heartbeats continue
    importer = threading.Thread(target=_prepare_results, daemon=True)
    while not flight.is_over:
        if flight.outcome is not None and children.wait(0.0):
            return  # no process is left to shut down
        now_s = connection.now_s
        if interruption.reason:
            flight.abort(Outcome(Code.INTERRUPTED, interruption.reason, INTERRUPTED), now_s)
        failed = _failed_child(flight, children)
        if failed is not None:
            code = failed.exit_code if failed.exit_code in (USAGE, NO_ANSWER) else FAILED
            gone = any(child.name == STACK for child in children.ended())
            flight.abort(Outcome(Code.PROCESS_ENDED, failed.end_reason, code), now_s, vehicle_is_gone=gone)
        _show_notices(children, display)
        flight.step(now_s)
        display.update(flight)
        if not flight.is_over:
            connection.step(now_s + _STEP_S)
        if flight.phase is Phase.FLY and importer.ident is None:
            importer.start()


def _prepare_results() -> None:
    with contextlib.suppress(CliError):  # the report raises it again
        importlib.import_module(_RESULTS).prepare()


def _show_notices(children: Children, display: Display) -> None:
    for line in children.notices():
        display.note(line)


def _failed_child(flight: Flight, children: Children) -> Child | None:
    """Return the child whose end ended the other one, or None if both run or the flight has ended.

    A child that shut down in order, or lost the other, may end before the one that failed.
    """
    if flight.outcome is not None or not (children.ended() or flight.view.powered_off):
        return None
    return children.culprit(_END_TIMEOUT_S)


def run_fly(
    options: FlyOptions, run: RunOptions, out: Path | None, prepared: PreparedPrograms | None = None
) -> None:
    """Fly the mission, write the results to ``out`` and print a summary; raise CliError, ConfigError."""
    items = checked_plan(options)
    console = FlyConsole(stderr=run.as_json, highlight=False)
    display = make_display(console)
    try:
        flown = fly(options, items, out, display, run.overwrite, prepared)
    finally:
        display.close()
    results = importlib.import_module(_RESULTS)  # late: see run_flight
    summary, outcome, failure = results.write_results(options, items, flown)
    if run.as_json:
        print(json.dumps({**summary, "directory": str(flown.folder)}), flush=True)
    else:
        results.print_summary(console, summary, flown.folder)
    report = flown.folder / REPORT_NAME
    if run.open_report and report.exists():
        show_page(report)
    if not outcome.completed:
        if failure is not None:
            complain(f"gcs: {failure}")
        raise CliError(f"{outcome.reason} (see {flown.folder})", outcome.exit_code)
    if failure is not None:
        raise failure
