"""Build the flight stack process from the options of its command, and run it.

A module of its own: ``--help`` does not import it, which takes half a second.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from flightstack.core.atomic_file import check_creatable, check_new
from flightstack.core.errors import ConfigError, TargetError
from flightstack.core.port_numbers import simulator_port, system_id
from flightstack.firmware.choice import PYTHON
from flightstack.params.config import CLOCKS, DEFAULT_HOME, FLOWN_ON, StackConfig, parse_home
from flightstack.params.gains_file import hidden_gains
from flightstack.params.param_file import begin_param_file
from flightstack.params.vehicle import hidden_vehicle
from flightstack.process import collection, compile_helper
from flightstack.process.app import App
from flightstack.process.assembly import build, kernels_of
from flightstack.process.clock import nearest_outer_hz
from flightstack.process.compile_notice import announce_compilation
from flightstack.process.config_check import DIRECTORY_HINT, check_state
from flightstack.process.console import say
from flightstack.process.log_files import default_log
from flightstack.process.options import RunOptions
from flightstack.process.ports import described, ports_config, warning
from flightstack.process.process_config import EXIT_TIMEOUT, EXIT_USAGE, ProcessConfig, complain
from flightstack.process.state_directory import StateDirectory
from flightstack.transports.udp import PortBusyError


def run(given: RunOptions) -> int | None:
    """Build the process and run it; return its exit code, or None after ``--check``."""
    try:
        started = _start(given)
    except (ConfigError, PortBusyError) as error:
        complain(error)
        return EXIT_USAGE
    except TargetError as error:
        complain(error)
        return EXIT_TIMEOUT
    if started is None:
        return None
    _print_summary(*started)
    collection.resume()
    return started[0].run()


def _start(given: RunOptions) -> tuple[App, StackConfig, ProcessConfig] | None:
    """Build the process and its configuration, or None after ``--check``.

    Raise ConfigError, TargetError or PortBusyError.
    """
    _check_combinations(given)
    directory = _state_directory(given)
    config = _stack_config(given, directory)
    _print_warnings(given)
    announce_compilation("flightstack", kernels_of(config))
    if config.loops == PYTHON:
        compile_helper.start(kernels_of(config), later=_later(config))
    if given.check:
        _check(config)
        return None
    process = _process_config(given, directory)
    config = _open_files(given, directory, config, process)
    return App(config, process), config, process


def _later(config: StackConfig) -> tuple[str, ...]:
    """Return the tasks of the compile helper for which nothing waits."""
    ticks = (compile_helper.QUIET_TICKS,) if config.lockstep else ()
    return (*compile_helper.estimator_tasks(config), *ticks)


def _check_combinations(given: RunOptions) -> None:
    check_state(given.state, DIRECTORY_HINT)
    if given.clock not in CLOCKS:
        raise ConfigError("--clock", given.clock, f"is not one of {', '.join(CLOCKS)}")
    if given.allow_unsigned and given.signing_key is None:
        raise ConfigError("--allow-unsigned", "", "needs --signing-key")


def _state_directory(given: RunOptions) -> StateDirectory | None:
    """Return the directory of saved parameters and plans, or None if nothing is saved."""
    if given.state_dir == "none" or (given.state_dir is None and given.params == "none"):
        return None
    path = None if given.state_dir is None else Path(given.state_dir)
    return StateDirectory(path, given.instance, has_params=given.params is None)


def _stack_config(given: RunOptions, directory: StateDirectory | None) -> StackConfig:
    outer_hz = nearest_outer_hz(given.inner_hz) if given.outer_hz is None else given.outer_hz
    return StackConfig(
        vehicle=given.vehicle,
        controller=given.controller,
        gains=given.gains,
        loops=given.loops,
        inner_hz=given.inner_hz,
        outer_hz=outer_hz,
        state=given.state,
        ideal_rotors=given.ideal_rotors,
        lockstep=given.clock == "lockstep",
        home=DEFAULT_HOME if given.home is None else parse_home(given.home),
        system_id=system_id(given.instance),
        params_file=_param_file(given, directory),
        params=tuple(given.param or []),
    )


def _param_file(given: RunOptions, directory: StateDirectory | None) -> str | None:
    if given.params is not None:
        return None if given.params == "none" else given.params
    return None if directory is None else str(directory.params)


def _print_warnings(given: RunOptions) -> None:
    """Warn of names that may be typing errors: files hidden by built-in names, and a missing parameter file."""
    for text in (hidden_vehicle(given.vehicle), hidden_gains(given.gains)):
        if text is not None:
            complain(text)
    file = given.named_params
    if file is not None and not file.exists():
        complain(f"warning: {file}: no such file, starting with the defaults; it will keep changes")


def _check(config: StackConfig) -> None:
    """Build the stack, which compiles the loops, and report success; raise ConfigError."""
    stack = build(config, lambda: None)
    stack.loops.close()
    say(f"flightstack: {stack.vehicle.name} with {config.controller} ({config.gains}) is ready to fly")


def _process_config(given: RunOptions, directory: StateDirectory | None) -> ProcessConfig:
    return ProcessConfig(
        simulator_host=given.sim_host,
        simulator_port=simulator_port(given.instance) if given.sim_port is None else given.sim_port,
        simulator_timeout_s=given.sim_timeout,
        ports=ports_config(
            given.instance, given.gcs or [], given.gcs_port, given.api_port, given.listen, given.tcp_port
        ),
        log=_log_path(given),
        wait_for_start=given.wait_for_start,
        exit_on_ground_loss_s=given.exit_on_gcs_loss,
        signing_key=given.signing_key,
        allow_unsigned=given.allow_unsigned,
        overwrite_log=given.overwrite,
        state=None if directory is None else directory.path,
    )


def _log_path(given: RunOptions) -> Path | None:
    """Return the log of the first flight, or None for no logs."""
    if given.log == "none":
        return None
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return default_log(given.instance, stamp) if given.log is None else Path(given.log)


def _open_files(
    given: RunOptions, directory: StateDirectory | None, config: StackConfig, process: ProcessConfig
) -> StackConfig:
    """Lock the state directory, check the log's path and create a named parameter file; raise ConfigError.

    Return the configuration with the parameter file that the state directory holds now.
    """

    if directory is not None:
        if (notice := directory.open()) is not None:
            complain(notice)
        config = replace(config, params_file=_param_file(given, directory))
    if given.log is not None and process.log is not None:
        check_new(process.log, given.overwrite)
        check_creatable(process.log)
    file = given.named_params
    if file is not None and not file.exists():
        begin_param_file(file, config.system_id)
    return config


def _print_summary(vehicle_process: App, config: StackConfig, process: ProcessConfig) -> None:
    """Print vehicle, loops and ports, and warnings about the parameter file and open ports."""
    stack = vehicle_process.stack
    if config.params_file is not None:
        unknown = stack.loaded_params.warning(Path(config.params_file))
        if unknown is not None:
            complain(f"warning: {unknown}")
    clock = "lockstep" if config.lockstep else "realtime"
    say(
        f"flightstack: {stack.vehicle.name}, {config.controller} ({config.gains}), "
        f"{FLOWN_ON[config.state]}, {_loops_text(config)}{config.inner_hz:g}/{config.outer_hz:g} Hz, {clock}; "
        f"simulator {process.simulator_host}:{process.simulator_port}, {described(process.ports)}, "
        f"{_state_text(config, process)}"
    )
    signed = process.signing_key is not None and not process.allow_unsigned
    if (caution := warning(process.ports, signed=signed)) is not None:
        complain(caution)


def _state_text(config: StackConfig, process: ProcessConfig) -> str:
    """Return where parameters and plans are saved."""
    text = "no state kept" if process.state is None else f"state in {process.state}"
    named = config.params_file is not None and (
        process.state is None or Path(config.params_file).parent != process.state
    )
    return f"{text}, parameters in {config.params_file}" if named else text


def _loops_text(config: StackConfig) -> str:
    return "" if config.loops == "python" else f"loops {config.loops}, "
