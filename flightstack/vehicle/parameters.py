"""Parameters of the vehicle: declaration, loading, and propagation of changes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flightstack.control.controller_loading import controller_error
from flightstack.params.behaviour import FIELDS, SPECS, Behaviour
from flightstack.params.config import ESTIMATED, StackConfig, identity_specs
from flightstack.params.estimator import ESTIMATOR_SPECS
from flightstack.params.param_file import NOTHING_LOADED, LoadedParams, load_into
from flightstack.params.spec import ParamSpec
from flightstack.params.store import ParamStore, apply_assignments
from flightstack.params.vehicle import load_vehicle
from flightstack.params.vehicle_defaults import with_defaults

if TYPE_CHECKING:  # a check of the parameters needs no vehicle
    from flightstack.control.backend import ControlBackend
    from flightstack.flight_log.recorder import FlightRecorder
    from flightstack.vehicle.assembly import VehicleParts


class Parameters(NamedTuple):
    """Parameters of a vehicle at its start."""

    store: ParamStore
    loaded: LoadedParams
    """Content of the parameter file."""


def declared(config: StackConfig, of_loops: Iterable[ParamSpec]) -> list[ParamSpec]:
    """Return the declarations of all parameters; raise ConfigError if a controller redeclares a name."""
    of_estimator = ESTIMATOR_SPECS.values() if config.state == ESTIMATED else ()
    own = with_defaults((*SPECS.values(), *of_estimator), load_vehicle(config.vehicle).default_params)
    specs = {spec.name: spec for spec in (*own, *identity_specs(config.system_id))}
    for spec in of_loops:
        if specs.setdefault(spec.name, spec) is not spec and SPECS.get(spec.name) is not spec:
            problem = f"declares the parameter {spec.name}, which the vehicle has already"
            raise controller_error(config.controller, problem)
    return list(specs.values())


def read_parameters(config: StackConfig, of_loops: Iterable[ParamSpec]) -> Parameters:
    """Read the parameters of a vehicle; ``of_loops`` declares those of its loops. Raise ConfigError.

    In rising precedence: defaults, those of gains file and vehicle file, the parameter file, and the configuration
    (``--param``), which is not saved.
    """
    store = ParamStore(declared(config, of_loops))
    loaded = NOTHING_LOADED
    if config.params_file is not None:
        loaded = load_into(store, Path(config.params_file))
    for name, value in config.behaviour.by_name().items():
        if value != SPECS[name].default:
            store.override(name, value)
    apply_assignments(store, config.params)
    return Parameters(store, loaded)


def load_parameters(config: StackConfig, backend: ControlBackend) -> Parameters:
    """Read the parameters of a vehicle and set those of the loops; raise ConfigError."""
    parameters = read_parameters(config, backend.parameter_specs)
    for spec in backend.parameter_specs:
        value = parameters.store.value(spec.name)
        if value != backend.get_parameter(spec.name):
            backend.set_parameter(spec.name, value)
    return parameters


def behaviour_of(store: ParamStore) -> Behaviour:
    """Return the parameters of guidance and commander."""
    values: dict[str, float] = {field: store.value(name) for name, field in FIELDS.items()}
    return Behaviour(**values)  # type: ignore[arg-type]  # an integer parameter's value is an int


def connect_parameters(store: ParamStore, parts: VehicleParts, recorder: FlightRecorder) -> None:
    """Propagate every change to guidance, commander, loops and log, before the next tick."""
    backend = parts.backend
    loops = {spec.name for spec in backend.parameter_specs}

    def on_change(name: str, value: float) -> None:
        if name in SPECS:
            parts.set_behaviour(parts.now.behaviour.updated(name, value))
        if name in loops:
            backend.set_parameter(name, value)
        recorder.parameter(name, value)

    store.subscribe(on_change)
