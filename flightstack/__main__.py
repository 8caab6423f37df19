"""The ``flightstack`` command: from its options to a process that flies."""

from __future__ import annotations

import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from flightstack.process import console, options
from flightstack.process.command_line import UsageError, Version, make_app
from flightstack.process.console import say

if TYPE_CHECKING:  # the rest is imported when it runs: help stays quick
    from flightstack.params.config import StackConfig
    from flightstack.process.app import App
    from flightstack.process.process_config import ProcessConfig
    from flightstack.process.state_directory import StateDirectory

app = make_app(name="flightstack")


@app.command()
def run(
    vehicle: options.Vehicle = "paper_quad",
    controller: options.Controller = "pid",
    gains: options.Gains = "tuned",
    inner_hz: options.InnerHz = 500.0,
    outer_hz: options.OuterHz = None,
    clock: options.Clock = "lockstep",
    loops: options.Loops = "python",
    sim_host: options.SimHost = "127.0.0.1",
    sim_port: options.SimPort = None,
    sim_timeout: options.SimTimeout = 30.0,
    instance: options.Instance = 0,
    gcs: options.GroundStations = None,
    gcs_port: options.GcsPort = None,
    api_port: options.ApiPort = None,
    tcp_port: options.TcpPort = None,
    listen: options.Listen = "127.0.0.1",
    signing_key: options.SigningKey = None,
    allow_unsigned: options.AllowUnsigned = False,
    log: options.LogFile = None,
    overwrite: options.Overwrite = False,
    param: options.Assignments = None,
    params: options.ParamFile = None,
    state: options.State = None,
    home: options.Home = None,
    ideal_rotors: options.IdealRotors = False,
    wait_for_start: options.WaitForStart = False,
    check: options.Check = False,
    exit_on_gcs_loss: options.ExitOnGcsLoss = None,
    version: Version = False,  # its callback does all
) -> None:
    """Fly: connect to a simulator, run the control loops, and serve ground stations over MAVLink."""
    from flightstack.core.atomic_file import check_new
    from flightstack.core.errors import ConfigError, TargetError
    from flightstack.core.port_numbers import simulator_port, system_id
    from flightstack.params.config import DEFAULT_HOME, StackConfig, parse_home
    from flightstack.params.gains_file import hidden_gains
    from flightstack.params.vehicle import hidden_vehicle
    from flightstack.process.app import App
    from flightstack.process.assembly import kernels_of
    from flightstack.process.clock import nearest_outer_hz
    from flightstack.process.compile_notice import announce_compilation
    from flightstack.process.ports import ports_config
    from flightstack.process.process_config import EXIT_TIMEOUT, EXIT_USAGE, ProcessConfig, complain
    from flightstack.transports.udp import PortBusyError

    try:
        if clock not in ("lockstep", "realtime"):
            raise ConfigError("--clock", clock, "is not one of lockstep, realtime")
        if allow_unsigned and signing_key is None:
            raise ConfigError("--allow-unsigned", "", "is for --signing-key: without a key all is unsigned")
        kept = _state_directory(state, params, instance)
        config = StackConfig(
            vehicle, controller, gains, loops, inner_hz,
            nearest_outer_hz(inner_hz) if outer_hz is None else outer_hz,
            ideal_rotors, clock == "lockstep",
            DEFAULT_HOME if home is None else parse_home(home), system_id(instance),
            params_file=_param_file(params, kept),
            params=tuple(param or []),
        )  # fmt: skip
        for sentence in (hidden_vehicle(vehicle), hidden_gains(gains)):
            if sentence is not None:
                complain(sentence)
        named_file = None if params in (None, "none") else Path(str(params))
        if named_file is not None:
            _mention_new(named_file)
        announce_compilation("flightstack", kernels_of(config))
        if check:
            _check(config)
            return
        process = ProcessConfig(
            sim_host,
            simulator_port(instance) if sim_port is None else sim_port,
            sim_timeout,
            ports_config(instance, gcs or [], gcs_port, api_port, listen, tcp_port),
            _log_path(log, instance),
            wait_for_start,
            exit_on_gcs_loss,
            signing_key,
            allow_unsigned,
            overwrite,
            None if kept is None else kept.path,
        )
        if kept is not None:
            if (sentence := kept.open()) is not None:
                complain(sentence)
            config = replace(config, params_file=_param_file(params, kept))
        if log is not None and process.log is not None:
            check_new(process.log, overwrite)
        if named_file is not None:
            _begin_new(named_file, config)
        vehicle_process = App(config, process)
    except (ConfigError, PortBusyError) as error:
        complain(error)
        sys.exit(EXIT_USAGE)
    except TargetError as error:
        complain(error)
        sys.exit(EXIT_TIMEOUT)
    _introduce(vehicle_process, config, process)
    sys.exit(vehicle_process.run())


def _state_directory(state: str | None, params: str | None, instance: int) -> StateDirectory | None:
    """Return where the vehicle keeps parameters and plans, or None if it is to keep nothing."""
    from flightstack.process.state_directory import StateDirectory

    if state == "none" or (state is None and params == "none"):
        return None
    return StateDirectory(None if state is None else Path(state), instance, has_params=params is None)


def _param_file(params: str | None, kept: StateDirectory | None) -> str | None:
    if params is not None:
        return None if params == "none" else params
    return None if kept is None else str(kept.params)


def _log_path(log: str | None, instance: int) -> Path | None:
    """Return the first flight's log, or None for no logs."""
    from flightstack.process.log_files import default_log

    if log == "none":
        return None
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return default_log(instance, stamp) if log is None else Path(log)


def _mention_new(file: Path) -> None:
    """Say when a parameter file that was named is not there: it may be a typing error."""
    from flightstack.process.process_config import complain

    if not file.exists():
        complain(f"warning: {file}: there is no such file: it begins with the defaults")


def _begin_new(file: Path, config: StackConfig) -> None:
    """Begin a parameter file that is not there; raise ConfigError."""
    from flightstack.params.param_file import begin_param_file

    if not file.exists():
        begin_param_file(file, config.system_id)


def _check(config: StackConfig) -> None:
    """Build the stack, which compiles the loops, and say that it can fly; raise ConfigError."""
    from flightstack.process.assembly import build

    stack = build(config, lambda: None)
    stack.loops.close()
    say(f"flightstack: {stack.vehicle.name} with {config.controller} ({config.gains}) is ready to fly")


def _introduce(vehicle_process: App, config: StackConfig, process: ProcessConfig) -> None:
    """Say what flies and where it is reached, and what the user should know about it."""
    from flightstack.process.ports import described, warning
    from flightstack.process.process_config import complain

    stack = vehicle_process.stack
    if config.params_file is not None:
        unknown = stack.loaded_params.warning(Path(config.params_file))
        if unknown is not None:
            complain(f"warning: {unknown}")
    clock = "lockstep" if config.lockstep else "realtime"
    say(
        f"flightstack: {stack.vehicle.name}, {config.controller} ({config.gains}), "
        f"{_loops_words(config)}{config.inner_hz:g}/{config.outer_hz:g} Hz, {clock}; "
        f"simulator {process.simulator_host}:{process.simulator_port}, {described(process.ports)}, "
        f"{_kept_words(config, process)}"
    )
    signed = process.signing_key is not None and not process.allow_unsigned
    if (caution := warning(process.ports, signed=signed)) is not None:
        complain(caution)


def _kept_words(config: StackConfig, process: ProcessConfig) -> str:
    """Say where parameters and plans are kept."""
    words = "no state kept" if process.state is None else f"state in {process.state}"
    named = config.params_file is not None and (
        process.state is None or Path(config.params_file).parent != process.state
    )
    return f"{words}, parameters in {config.params_file}" if named else words


def _loops_words(config: StackConfig) -> str:
    return "" if config.loops == "python" else f"loops {config.loops}, "


def main() -> None:
    """Run the command."""
    console.replace_unencodable()
    try:
        sys.exit(app(prog_name="flightstack", standalone_mode=False))
    except UsageError as error:
        console.complain(f"flightstack: {error.format_message()}")
        sys.exit(2)
    except OSError as error:
        sys.exit(console.report_os_error("flightstack", error))


if __name__ == "__main__":
    main()
