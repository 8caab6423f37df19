"""Build a flight stack from its configuration, without clock and transports, and transfer state at a reboot.

The process (``app``) and in-process tests use the same stack.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

from flightstack import __version__
from flightstack.control.backend import ControlBackend
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.firmware.c_loops import LoopsSetup
from flightstack.firmware.choice import PYTHON
from flightstack.firmware.law_tree import own_params
from flightstack.firmware.targets import make_filter, make_loops
from flightstack.flight_log.flight_log import vehicle_fields
from flightstack.flight_log.local_position import SENSED_OUTER
from flightstack.flight_log.recorder import FlightRecorder, OpenLog
from flightstack.flight_log.sensor_recorder import SENSOR_GROUPS, SensorRecorder
from flightstack.flight_log.topics import OUTER_GROUP
from flightstack.guidance.safe_places import SafePlaces
from flightstack.params.config import AUTOPILOT, ESTIMATED, GENERIC, SYSTEM_ID, StackConfig
from flightstack.params.estimator import MULTI_IMU
from flightstack.params.param_file import LoadedParams
from flightstack.params.store import ParamStore
from flightstack.params.vehicle import Vehicle
from flightstack.process import compile_helper
from flightstack.process.clock import LoopTiming, Rates, TimingReport, rates
from flightstack.process.config_check import loops_setup
from flightstack.services.commands.context import PrepareReboot, VehicleContext, always_reboots
from flightstack.services.logs.log_store import NO_LOGS, LogStore
from flightstack.services.routing.hub import GroundHub
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.simulator_link.endpoint import SimulatorEndpoint
from flightstack.vehicle.assembly import VehicleParts, assemble
from flightstack.vehicle.autopilot import TickingAutopilot
from flightstack.vehicle.estimation import Estimation, SensorAutopilot, Users
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.parameters import (
    behaviour_of,
    connect_parameters,
    load_parameters,
)
from flightstack.vehicle.plans import FlightArea
from flightstack.vehicle.status import (
    VehicleInfo,
    VehicleStatus,
    vehicle_info,
    vehicle_status,
    vehicle_summary,
)

_KERNELS = (
    "inner_kernel", "outer_kernel", "rest_kernel", "levelling_kernel", "goal_kernel",
    "follow_rotors", "detect", "fence_step", "store_outer_row", "put_rows", "read_motion", "pack_frames",
)  # fmt: skip
_LOOP_KERNELS = ("inner_kernel", "outer_kernel")
_ESTIMATOR_KERNELS = (
    "imu_kernel", "push_kernel", "field_kernel", "update_health", "report_kernel", "store_local_position",
    "store_estimator",
)  # fmt: skip
_C_FILTER_KERNELS = ("move_clock_kernel",)
"""Kernels that read the memory of the estimator in C."""
_REAL_TIME_KERNELS = ("stream_kernel",)
"""Kernels that a vehicle in lockstep compiles or loads at their first use."""


LoopsMaker: TypeAlias = Callable[[str, LoopsSetup, bool], ControlBackend]


class Stack(NamedTuple):
    """The parts of a flight stack that a process or a test uses."""

    vehicle: Vehicle
    rates: Rates
    simulator: SimulatorEndpoint
    parts: VehicleParts
    ground: GroundHub
    recorder: FlightRecorder
    timing: LoopTiming
    report: TimingReport
    params: ParamStore
    loaded_params: LoadedParams
    """Contents of the parameter file at startup."""
    loops: ControlBackend
    status: Callable[[], VehicleStatus]
    """Returns the current status."""
    autopilot: TickingAutopilot
    estimation: Estimation | None
    """None for a vehicle that flies on the simulator's state."""

    @property
    def is_ready(self) -> bool:
        """True if the state is known well enough to take off: at once on the simulator's, after seconds on sensors."""
        return self.estimation is None or self.estimation.is_ready()

    @property
    def now(self) -> FlightState:
        """The current flight state."""
        return self.parts.now

    @property
    def journal(self) -> Journal:
        """Events for telemetry and the log."""
        return self.parts.journal

    @property
    def places(self) -> SafePlaces:
        """Home, geofence and rally points."""
        return self.parts.places

    @property
    def area(self) -> FlightArea:
        """The area in which the vehicle may fly."""
        return self.parts.area


def kernels_of(config: StackConfig) -> tuple[str, ...]:
    """Return the names of the kernels that ``build`` compiles or loads: those of the loops, then the other ones."""
    needs_loops = config.loops == PYTHON
    kernels = tuple(name for name in _KERNELS if needs_loops or name not in _LOOP_KERNELS)
    kernels += _ESTIMATOR_KERNELS if config.state == ESTIMATED else ()
    kernels += () if needs_loops or config.state != ESTIMATED else _C_FILTER_KERNELS
    return kernels if config.lockstep else kernels + _REAL_TIME_KERNELS


def build(
    config: StackConfig,
    open_log: OpenLog,
    logs: LogStore = NO_LOGS,
    prepare_reboot: PrepareReboot = always_reboots,
    make: LoopsMaker = make_loops,
) -> Stack:
    """Build a stack with the loops of ``make`` that serves ``logs`` to ground stations.

    The compile helper and this process share the compilation. Raise ConfigError for an invalid configuration.
    """
    loop_rates = rates(config.inner_hz, config.outer_hz)
    setup = loops_setup(config, loop_rates)
    if config.loops == PYTHON:
        compile_helper.start()
    backend = make(config.loops, setup, config.lockstep)
    compile_helper.finish(with_streams=not config.lockstep)
    try:
        return _join(config, setup, loop_rates, backend, open_log, logs, prepare_reboot)
    except BaseException:
        backend.close()  # a target may hold a process or a serial port
        raise


def _recorder(
    open_log: OpenLog,
    info: dict[str, str | int | float],
    params: ParamStore,
    simulator: SimulatorEndpoint,
    home: GeoPoint,
) -> FlightRecorder:
    topics = ((), OUTER_GROUP) if simulator.sensors is None else (SENSOR_GROUPS, SENSED_OUTER)
    return FlightRecorder(open_log, info, params.values, home, lambda: simulator.battery, *topics)


def _join(
    config: StackConfig,
    setup: LoopsSetup,
    loop_rates: Rates,
    backend: ControlBackend,
    open_log: OpenLog,
    logs: LogStore,
    prepare_reboot: PrepareReboot,
) -> Stack:
    params, loaded = load_parameters(config, backend)
    behaviour, system_id = behaviour_of(params), int(params.value(SYSTEM_ID))
    info = _log_info(config, setup, loop_rates, backend.version)
    simulator = SimulatorEndpoint(
        setup.vehicle, config.home, config.lockstep, system_id, loop_rates.interval_us,
        uses_sensors=config.state == ESTIMATED,
    )  # fmt: skip
    recorder = _recorder(open_log, info, params, simulator, config.home)
    parts = assemble(
        setup.vehicle, backend, behaviour, config.home, loop_rates.divisor, loop_rates.outer_hz, recorder,
        simulator.state, simulator.rotor_speed_rad_s, simulator,
    )  # fmt: skip
    parts.warm_up(with_streams=not config.lockstep)
    autopilot, estimation = _on_sensors(parts, simulator, params, recorder, config.home)
    connect_parameters(params, parts, recorder)
    timing = LoopTiming(round(1e9 / loop_rates.inner_hz))
    report = TimingReport(timing, loop_rates, config.lockstep)
    generic = params.value(AUTOPILOT) == GENERIC
    vehicle_id = vehicle_info(setup.vehicle, system_id, generic, parts.places.frame)
    status = _status(vehicle_id, parts, simulator, estimation)
    summary, has_sensors = partial(vehicle_summary, vehicle_id, parts), estimation is not None
    telemetry = Telemetry(status, summary, parts.now, parts.places, vehicle_id, report.message, has_sensors)
    context = VehicleContext.of(parts, params, simulator, generic, logs, prepare_reboot)
    ground = GroundHub(context, parts, telemetry, vehicle_id)
    return Stack(
        setup.vehicle, loop_rates, simulator, parts, ground, recorder, timing, report, params, loaded, backend, status,
        autopilot, estimation,
    )  # fmt: skip


def _status(
    info: VehicleInfo, parts: VehicleParts, simulator: SimulatorEndpoint, estimation: Estimation | None
) -> Callable[[], VehicleStatus]:
    """Return the function that returns the current status."""

    def status() -> VehicleStatus:
        sensed = None if estimation is None else estimation.sensed()
        return vehicle_status(info, parts, simulator.battery, sensed)

    return status


def _on_sensors(
    parts: VehicleParts,
    simulator: SimulatorEndpoint,
    params: ParamStore,
    recorder: FlightRecorder,
    home: GeoPoint,
) -> tuple[TickingAutopilot, Estimation | None]:
    """Return the autopilot to tick; that of a vehicle on sensors estimates its state first.

    ``home`` is the origin of the simulator's true state.
    """
    if simulator.sensors is None:
        return parts.autopilot, None
    core, imu_count = make_filter(parts.backend), parts.vehicle.sensors.imu_count
    if core is not None and min(imu_count, int(params.value(MULTI_IMU.name))) > 1:
        problem = f"follows one inertial sensor, and the vehicle has {imu_count}: set EKF2_MULTI_IMU to 1"
        raise ConfigError("--loops", "", f"the estimator in C {problem}")
    users = Users(parts.area, parts.failsafes, parts.navigator, parts.backend, parts.journal)
    sensor_recorder = SensorRecorder(recorder, parts.places.frame, home)
    estimation = Estimation(
        simulator.sensors, parts.now, users, params, sensor_recorder, simulator.known_truth,
        imu_count, core,
    )  # fmt: skip
    estimation.warm_up()
    parts.area.await_origin()
    return SensorAutopilot(parts.autopilot, estimation), estimation


def _log_info(
    config: StackConfig, setup: LoopsSetup, loop_rates: Rates, loops_version: str
) -> dict[str, str | int | float]:
    """Return the information messages of a log.

    ``law_params`` has the parameters of laws from other packages at the start, which a replay needs: not all are
    parameters of the vehicle.
    """
    return {
        "sys_name": "flightstack",
        "ver_sw": __version__,
        **vehicle_fields(setup.vehicle),
        "controller": config.controller,
        "gains": config.gains,
        "loops": config.loops,
        "ver_loops": loops_version,
        "inner_hz": loop_rates.inner_hz,
        "outer_hz": loop_rates.outer_hz,
        **own_params(setup),
    }


def reboot_config(stack: Stack, config: StackConfig) -> StackConfig:
    """Return the configuration after a reboot; without a parameter file it contains the current values."""
    if config.params_file is not None:
        return config
    changed = [name for name in stack.params.specs if not stack.params.is_default(name)]
    return replace(config, params=tuple(f"{name}={stack.params.value(name)!r}" for name in changed))


def transfer_state(old: Stack, new: Stack) -> None:
    """Copy peers, plans, home and the newest state to the new stack at a reboot. The estimator restarts.

    Until the first fix, a stack with an estimator has the origin of the old one, near which home was checked.
    Vehicle clock, modes, failsafes, sequence numbers, transfers, counters and timing restart. The process keeps signing
    timestamps, the number of the next log, and the parameter file for all stacks.
    """
    for address, permanent in old.ground.addresses():
        new.ground.add_peer(address, permanent)
    if new.estimation is not None:
        new.area.move_origin(old.places.frame.origin)
    new.area.set_home(old.area.home, old.places.home_is_chosen)
    new.ground.adopt_plans(old.ground)
    new.ground.last_heard_s = old.ground.last_heard_s
    new.simulator.resume(old.simulator)
    new.now.has_state = old.now.has_state and new.estimation is None
