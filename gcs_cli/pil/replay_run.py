"""``gcs pil replay``: feed the inputs of a log to a target, and compare its outputs with the log."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError, TargetError
from flightstack.firmware.c_loops import CLoops, LoopsSetup
from flightstack.firmware.choice import PYTHON, SERIAL, LoopsChoice
from flightstack.firmware.law_tree import controller_named, logged_params, own_params
from flightstack.firmware.numbers import FIRST_NUMBERS
from flightstack.firmware.stages import has_model
from flightstack.firmware.targets import finish_loops, make_loops
from flightstack.flight_log.flight_log import vehicle_fields
from flightstack.params.behaviour import SPECS
from flightstack.params.gains_file import DEFAULT_GAINS, open_gains
from flightstack.params.vehicle import Vehicle, load_vehicle
from gcs_cli.errors import NO_ANSWER, USAGE, CliError
from gcs_cli.logs.reader import warn_if_damaged
from gcs_cli.pil.code_facts import code_facts
from gcs_cli.pil.compare import Difference, compared, deviation
from gcs_cli.pil.flight_samples import FlightSamples, read_samples
from gcs_cli.pil.replay import Recording, UnfitLogError, as_flight, recording, replayed
from gcs_cli.pil.report_charts import DeviationChart
from gcs_cli.pil.result import (
    Outcome,
    assembled,
    costs_of,
    largest_difference,
    pair_name,
    profiles_of,
    status_check,
    target_checks,
    target_tiles,
)
from gcs_cli.pil.signals import BY_NAME, TARGET
from gcs_cli.pil.stagewise import STAGEWISE, expected_outputs
from gcs_cli.pil.target_record import TargetRecord, read_record
from gcs_cli.pil.targets import has_same_bits, meaning
from gcs_cli.pil.vectors import SUFFIXES, read_vectors
from gcs_cli.pil.verdict import (
    DEFAULT_LIMITS,
    Check,
    Limits,
    LimitSet,
    board_limits,
    difference_checks,
    same_bits_limits,
)
from gcs_cli.run_directory import LOG_NAME
from gcs_cli.tui.widgets.transfer_bar import step_bar

LOG = "log"
_TILT = "MPC_TILTMAX_AIR"
_OF_TARGET = "FS_"
"""Prefix of numbers of a target that are no parameters."""
_SHOWN = ("target_attitude", "reference_acceleration", "torque", "rotor_command")
_MASS_TOLERANCE = 1e-6


class Replay(NamedTuple):
    """Inputs for the target, and the configuration of its loops."""

    flight: FlightSamples
    record: Recording
    setup: LoopsSetup
    numbers: Mapping[str, float]
    """Parameters of the loops at the start of the log."""


def prepared(source: Path, vehicle: str | None) -> Replay:
    """Read a log or a file of test vectors and configure the loops; raise ConfigError, CliError (usage)."""
    if source.suffix.lower() in SUFFIXES:
        vectors = read_vectors(source)
        flight, record = vectors.as_flight(), vectors.record
    else:
        flight, record = read_flight(source)
    setup = _setup(flight, source, vehicle)
    names = setup.numbers()
    numbers = {name: value for name, value in flight.parameters.items() if name in names}
    return Replay(flight, record, setup, numbers)


def read_flight(log: Path) -> tuple[FlightSamples, Recording]:
    """Read a log, with a warning if it is damaged; raise ConfigError."""
    flight = read_samples(log)
    warn_if_damaged(flight, log)
    try:
        return flight, recording(flight)
    except UnfitLogError as error:
        raise ConfigError(log, "", f"cannot be replayed: {error}") from error


def configured(
    vehicle: str, controller: str, gains: str, inner_hz: float, outer_hz: float
) -> tuple[LoopsSetup, dict[str, Any], dict[str, float]]:
    """Return the setup of loops that did not fly, its info entries and its parameters; raise ConfigError."""
    flown = load_vehicle(vehicle)
    setup = LoopsSetup(
        flown,
        controller_named(controller),
        open_gains(gains),
        math.radians(SPECS[_TILT].default),
        inner_hz,
        outer_hz,
        max(1, round(inner_hz / outer_hz)),
    )
    info = {**vehicle_fields(flown), "controller": controller, "gains": gains}
    info |= {"inner_hz": inner_hz, "outer_hz": outer_hz, **own_params(setup)}
    own = {name: value for name, value in setup.numbers().items() if not name.startswith(_OF_TARGET)}
    return setup, info, own


def _setup(flight: FlightSamples, log: Path, vehicle: str | None) -> LoopsSetup:
    info = flight.info
    try:
        name, inner_hz, outer_hz = str(info["controller"]), float(info["inner_hz"]), float(info["outer_hz"])
        tilt_deg = flight.parameters[_TILT]
    except KeyError as error:
        raise ConfigError(log, "", f"cannot be replayed: it does not say its {error.args[0]}") from error
    controller = controller_named(name)
    return LoopsSetup(
        _vehicle(flight, log, vehicle),
        controller,
        open_gains(DEFAULT_GAINS),  # each gain is a parameter, and the values of the log replace them
        math.radians(tilt_deg),
        inner_hz,
        outer_hz,
        max(1, round(inner_hz / outer_hz)),
        logged_params(controller, str(info.get("law_params", "{}")), log),
    )


def _vehicle(flight: FlightSamples, log: Path, name: str | None) -> Vehicle:
    flown = str(flight.info.get("vehicle"))
    try:
        vehicle = load_vehicle(flown if name is None else name)
    except ConfigError:
        if name is not None:
            raise
        raise CliError(f"{log}: was flown by {flown}: give its file with --vehicle", USAGE) from None
    mass_kg, rotors = flight.info.get("mass_kg", math.nan), flight.info.get("rotor_count")
    is_same_mass = abs(mass_kg - vehicle.mass_kg) <= _MASS_TOLERANCE * vehicle.mass_kg
    if not is_same_mass or rotors != len(vehicle.rotors):
        raise CliError(f"{log}: was flown by another {flown}: give its file with --vehicle", USAGE)
    return vehicle if "rotor_max_speed_rad_s" in flight.info else vehicle.with_ideal_rotors()


def fed(replay: Replay, target: str, folder: Path, console: Console) -> tuple[FloatArray, str]:
    """Feed the inputs to the target, which writes its record to ``folder``; return outputs and version.

    Raise ConfigError, and CliError if the target is lost.
    """
    names = replay.setup.numbers()
    try:
        loops = make_loops(target, replay.setup)
        assert isinstance(loops, CLoops)
        with ExitStack() as last:
            last.callback(finish_loops, loops, folder / LOG_NAME)
            for name, value in (*FIRST_NUMBERS.items(), *replay.numbers.items()):
                loops.executor.set(name, value)
            with step_bar(f"replay on {target}", console) as bar:
                outputs = replayed(replay.record, loops.executor, names.__contains__, bar.show)
        return outputs, loops.version
    except TargetError as error:
        raise CliError(str(error), NO_ANSWER) from error
    except ValueError as error:  # a value that the C loops refuse
        raise CliError(f"the log's parameters cannot be replayed: {error}") from error


def replay(
    log: Path,
    choice: LoopsChoice,
    target: str,
    prepared_replay: Replay,
    folder: Path,
    console: Console,
    limits: LimitSet = DEFAULT_LIMITS,
) -> Outcome:
    """Replay a log on a target and compare; raise ConfigError, CliError."""
    outputs, version = fed(prepared_replay, target, folder, console)
    record = read_record(folder) if choice.is_target else None
    facts = {
        "title": f"{log.name} replayed: {target}",
        "about": f"{len(outputs)} steps of {log.name} · {version}",
        "meaning": f"Open loop: the inputs that the log holds are fed to the target, step by step, and its outputs "
        "compared with the log's, and stage by stage with Python's, computed in float64 from what the target reports. "
        f"{meaning(choice, replay=True)}",
        "conditions": _conditions(log, target, prepared_replay),
        "inner_hz": prepared_replay.setup.inner_hz,
        **code_facts(record, prepared_replay.setup.controller.name),
    }
    return outcome_of(prepared_replay, outputs, record, has_same_bits(choice), facts, limits)


def _conditions(log: Path, target: str, replay: Replay) -> dict[str, Any]:
    info = replay.flight.info
    names = ("vehicle", "controller", "gains", "loops", "ver_loops", "inner_hz", "outer_hz")
    return {"log": str(log), "target": target, **{name: info[name] for name in names if name in info}}


def _charts(pair: str, first: FlightSamples, made: FlightSamples) -> list[DeviationChart]:
    charts = [DeviationChart(BY_NAME[name], {pair: deviation(BY_NAME[name], first, made)}) for name in _SHOWN]
    return [chart for chart in charts if np.size(chart.pairs[pair].size)]


def outcome_of(
    replay: Replay,
    outputs: FloatArray,
    record: TargetRecord | None,
    same_bits: bool,
    facts: Mapping[str, Any],
    limits: LimitSet = DEFAULT_LIMITS,
) -> Outcome:
    """Compare the outputs with the log and with Python's stages, and check them. Pure."""
    flight, steps = replay.flight, replay.record
    made = as_flight(steps, outputs, {})
    modelled = has_model(replay.setup)
    computed = expected_outputs(steps, outputs, replay.setup, replay.numbers) if modelled else outputs
    expected = as_flight(steps, computed, {})
    pair, stages = pair_name(LOG, "target"), pair_name(STAGEWISE, "target")
    differences = list(compared(pair, flight, made))
    by_stage = list(compared(stages, expected, made)) if modelled else []
    left_out = None if steps.tells_targets else TARGET
    of_stages = limits.stages if same_bits else board_limits(limits.stages)
    checks = [
        *(_log_checks(pair, differences, replay, made, same_bits, limits.replay) if flight.signals else ()),
        *(_stage_checks(stages, by_stage, of_stages, left_out, expected, made) if modelled else ()),
        *(target_checks(record, len(outputs)) if record is not None else ()),
    ]
    result = assembled([*differences, *by_stage], checks, record, facts)
    result["meaning"] += _left_out(modelled, steps.tells_targets)
    shown = pair if differences else stages
    result["tiles"] = [
        {"name": f"largest difference {shown}", "value": largest_difference(differences or by_stage)},
        *target_tiles(record),
    ]
    first = flight if differences or expected is None else expected
    return Outcome(result, _charts(shown, first, made), profiles_of(record), costs_of(record))


def _left_out(modelled: bool, tells_targets: bool) -> str:
    """Return sentences about comparisons that cannot be made."""
    words = "" if modelled else " A law is written in C: it has no stage in Python to compare with."
    if not tells_targets:
        words += (
            " This log does not tell which attitude targets the outer loop made: all were given to the inner loop, "
            "and the outer loop did not run."
        )
    return words


def _stage_checks(
    pair: str,
    differences: Sequence[Difference],
    limits: Limits,
    left_out: str | None,
    expected: FlightSamples,
    made: FlightSamples,
) -> Iterator[Check]:
    """Yield the checks against Python's stages."""
    yield from difference_checks(pair, differences, limits, left_out)
    yield status_check(f"{pair} steps of another status", expected, made, False)


def _log_checks(
    pair: str,
    differences: Sequence[Difference],
    replay: Replay,
    made: FlightSamples,
    same_bits: bool,
    limits: Limits,
) -> Iterator[Check]:
    """Yield the checks against the outputs in the log, which has the same bits if C flew on the same arithmetic."""
    flown = str(replay.flight.info.get("loops", PYTHON))
    exact = same_bits and flown != PYTHON and not flown.startswith(SERIAL)
    if exact:
        limits = same_bits_limits(limits)
    elif not (flown == PYTHON or same_bits):
        limits = board_limits(limits)
    yield from difference_checks(pair, differences, limits, None if replay.record.tells_targets else TARGET)
    yield status_check(f"{pair} steps of another status", replay.flight, made, exact)
