"""The vehicle of a world and its conditions."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from flightstack.control.controller_loading import load_controller
from flightstack.control.loop_parameters import loop_numbers
from flightstack.core.contract import Vector3
from flightstack.core.errors import ConfigError, did_you_mean
from flightstack.core.geodesy import GeoPoint
from flightstack.firmware.c_loops import LoopsSetup
from flightstack.firmware.choice import PYTHON, parse_loops
from flightstack.firmware.targets import make_loops
from flightstack.params.config import (
    DEFAULT_CONTROLLER,
    DEFAULT_HOME,
    DEFAULT_INNER_HZ,
    DEFAULT_STATE,
    StackConfig,
)
from flightstack.params.gains_file import DEFAULT_GAINS, open_gains
from flightstack.params.vehicle import DEFAULT_VEHICLE, Vehicle, load_vehicle, load_vehicle_with
from flightstack.plan import Plan, load_plan
from flightstack.process.clock import nearest_outer_hz, rates
from flightstack.process.config_check import vehicle_of
from flightstack.vehicle.parameters import load_parameters, read_parameters
from gcs_cli.transfers.plan_files import example_plans
from sim_bridge.arguments import check_battery, check_boat, check_plant, check_range, check_slope
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.disturbance import Disturbance, check_wind
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator

Built = TypeVar("Built")

OPTION_KEYS = {"--param": "params"}
"""Conditions by the option of ``flightstack`` that sets them, where the names differ."""
_LARGEST_SEED = 2**63
_MOST_WIND_M_S, _MOST_GUST_M_S, _MOST_TORQUE_GUST_N_M = 200.0, 50.0, 100.0


@dataclass(frozen=True, kw_only=True)
class Setup:
    """The vehicle, its loops and the conditions of its flights. Equal setups fly equally, byte for byte.

    >>> Setup(vehicle="x_quad", wind=(5.0, 0.0), gust=1.0, seed=3).changed()
    {'vehicle': 'x_quad', 'wind': (5.0, 0.0), 'gust': 1.0, 'seed': 3}
    """

    vehicle: str = DEFAULT_VEHICLE
    """A built-in vehicle, or the path of a vehicle file."""
    controller: str = DEFAULT_CONTROLLER
    gains: str = DEFAULT_GAINS
    """A built-in set of gains, or the path of a gains file."""
    loops: str = "python"
    """``python``, ``c``, ``host`` or ``emulated``; see docs/reference/cli-flightstack.md."""
    state: str = DEFAULT_STATE
    """``estimated`` to fly on the vehicle's sensors, ``truth`` on the simulator's state."""
    plant: str = "rigid"
    """``rigid``, ``multibody`` or ``paper``."""
    wind: Sequence[float] = (0.0, 0.0)
    """Wind north, east and, optionally, down [m/s]."""
    gust: float = 0.0
    """Standard deviation of the gusts [m/s]."""
    drag: bool = False
    """True to give the vehicle the optional drag of its file; without drag wind has no effect and is refused."""
    force: Sequence[float] = (0.0, 0.0, 0.0)
    """Constant force NED [N]."""
    torque: Sequence[float] = (0.0, 0.0, 0.0)
    """Constant torque FRD [N m]."""
    torque_gust: float = 0.0
    """Standard deviation of the gusty torque about roll and pitch [N m]."""
    slope_deg: float = 0.0
    """Slope of the ground, which rises to the north; rigid plant."""
    boat: Sequence[float] = (0.0, 0.0)
    """Velocity of the ground north and east, as of a boat [m/s]."""
    battery_percent: float | None = None
    """Charge at the start; None: full."""
    battery_capacity_mah: float | None = None
    battery_drain: float | None = None
    """Factor on the discharge; None: 1."""
    ideal_rotors: bool = False
    """True for rotors without lag and limits, as in the paper."""
    inner_hz: float = DEFAULT_INNER_HZ
    outer_hz: float | None = None
    """Rate of the outer loop; None: the divisor of ``inner_hz`` nearest to 100 Hz."""
    home: GeoPoint = DEFAULT_HOME
    params: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the vehicle that differ from their defaults."""
    simulated: Mapping[str, float] = field(default_factory=dict)
    """Numbers of the simulated vehicle that differ from those of its file, on which the flight stack relies, by path:
    ``{"body.mass_kg": 0.6}``."""
    seed: int = 1
    """Seed of gusts and of the faults of links."""
    folder: Path | Sequence[Path] = Path()
    """One or more directories of plans; a name that is in none of them is that of an example plan."""

    def changed(self) -> dict[str, Any]:
        """Return the fields that differ from their defaults."""
        default = Setup()
        return {
            item.name: value
            for item in fields(self)
            if (value := getattr(self, item.name)) != getattr(default, item.name)
        }

    @classmethod
    def of(cls, conditions: Mapping[str, Any]) -> Setup:
        """Return the setup with ``conditions`` by name; raise TypeError for a name that is none."""
        names = [item.name for item in fields(cls)]
        for name in conditions:
            if name not in names:
                near = difflib.get_close_matches(name, names, n=1)
                hint = f"did you mean {near[0]}?" if near else f"the conditions are {', '.join(names)}"
                raise TypeError(f"{name} is no condition of a flight: {hint}")
        return cls(**conditions)

    def plan_path(self, plan: str | Path) -> Path:
        """Return the file of a plan: in ``folder``, else an example of the installation."""
        folders = (self.folder,) if isinstance(self.folder, Path) else self.folder
        for path in (folder / plan for folder in folders):
            if path.exists():
                return path
        example = example_plans().get(Path(plan).stem)
        is_name = example is not None and str(plan) in (example.stem, example.name)
        return example if example is not None and is_name else folders[0] / plan

    def load_plan(self, plan: str | Path) -> Plan:
        """Read a plan file, as ``plan_path`` finds it; raise ConfigError."""
        path = self.plan_path(plan)
        if not path.exists():
            examples = example_plans()
            problem = (
                f"cannot be read: No such file or directory; the example plans are {', '.join(examples)}"
            )
            raise ConfigError(path, "", f"{problem}{did_you_mean(Path(plan).stem, examples)}")
        return load_plan(path)

    def stack_config(self) -> StackConfig:
        """Return the configuration of the flight stack."""
        return StackConfig(
            vehicle=self.vehicle,
            controller=self.controller,
            gains=self.gains,
            loops=self.loops,
            inner_hz=self.inner_hz,
            outer_hz=nearest_outer_hz(self.inner_hz) if self.outer_hz is None else self.outer_hz,
            state=self.state,
            ideal_rotors=self.ideal_rotors,
            home=self.home,
            params=tuple(f"{name}={value!r}" for name, value in self.params.items()),
        )

    def check(self) -> Vehicle:
        """Check vehicle, controller, gains, loops, rates, parameters and conditions; return the vehicle.

        Raise ConfigError. Loops on a target are not connected.
        """
        config = self.stack_config()
        vehicle, loop_rates = vehicle_of(config), rates(config.inner_hz, config.outer_hz)
        self.plant_options(vehicle)
        parts = LoopsSetup(
            vehicle,
            load_controller(config.controller),
            open_gains(config.gains),
            math.radians(config.behaviour.max_tilt_deg),
            *loop_rates[:3],
        )
        if parse_loops(config.loops).kind == PYTHON:
            load_parameters(config, make_loops(PYTHON, parts))
        else:
            read_parameters(config, loop_numbers(*parts[:4]).specs)
        return vehicle

    def plant_options(self, vehicle: Vehicle) -> tuple[Vehicle, PlantOptions]:
        """Return the vehicle that is simulated and its conditions; raise ConfigError for those without effect."""
        if self.simulated:
            try:
                vehicle = load_vehicle_with(self.vehicle, self.simulated)
            except ConfigError as error:
                raise error.within("simulated", {}) from None
            vehicle = vehicle.with_ideal_rotors() if self.ideal_rotors else vehicle
        try:
            if self.drag:
                vehicle = vehicle.with_drag(self.plant)
            disturbance, seed = self._disturbance(), self._seed()
            check_wind(vehicle, check_plant(self.plant), disturbance)
            battery = check_battery(
                vehicle, self.battery_percent, self.battery_capacity_mah, self.battery_drain
            )
            boat = check_boat(_vector("boat", self.boat, 2, 2), "boat")
            slope_rad = check_slope(self.slope_deg, self.plant, boat, "slope_deg")
        except (UsageProblemError, ConfigError) as error:
            name, _, problem = str(error).partition(": ")
            name = name.removeprefix("--").replace("-", "_")
            raise ConfigError(name, "", with_keys(problem)) from None
        options = PlantOptions(disturbance, seed, battery=battery, slope_rad=slope_rad, boat_ned_m_s=boat)
        return vehicle, options

    def simulator(self, vehicle: Vehicle) -> Simulator:
        """Return the simulator of ``vehicle``; raise ConfigError for conditions that it cannot simulate."""
        flown, options = self.plant_options(vehicle)
        return Simulator(flown, self.plant, options)

    def _seed(self) -> int:
        if not isinstance(self.seed, Integral):
            raise UsageProblemError(f"seed: {self.seed!r} is not a whole number")
        return int(check_range("seed", int(self.seed), 0, _LARGEST_SEED))

    def _disturbance(self) -> Disturbance:
        wind = _vector("wind", self.wind, fewest=2)
        for speed_m_s in wind:
            check_range("wind", speed_m_s, -_MOST_WIND_M_S, _MOST_WIND_M_S)
        return Disturbance(
            wind,
            check_range("gust", self.gust, 0.0, _MOST_GUST_M_S),
            _vector("force", self.force),
            _vector("torque", self.torque),
            check_range("torque_gust", self.torque_gust, 0.0, _MOST_TORQUE_GUST_N_M),
        )


def with_keys(problem: str) -> str:
    """Return a problem with the keys of a setup for the options of a remedy."""
    return (
        problem.replace("add --drag", "set drag to true")
        .replace("--plant", "plant")
        .replace("--drag", "drag")
    )


def _vector(name: str, values: Sequence[float], fewest: int = 3, most: int = 3) -> Vector3:
    """Return ``fewest`` to ``most`` numbers as a vector, the others 0."""
    try:
        numbers = [] if isinstance(values, str) else [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if not fewest <= len(numbers) <= most:
        counts = f"{most}" if fewest == most else f"{fewest} or {most}"
        raise UsageProblemError(f"{name}: {values!r} must be {counts} numbers")
    return Vector3(*numbers, *[0.0] * (3 - len(numbers)))


def compile_plant() -> None:
    """Compile the kernels of the default plant, or load them from the cache."""
    Setup().simulator(load_vehicle(DEFAULT_VEHICLE))


def built(setup: Setup, make: Callable[[Setup], Built]) -> Built:
    """Return ``make(setup)``; its ConfigErrors name the conditions, not options of the command line."""
    try:
        return make(setup)
    except ConfigError as error:
        raise error.as_keyword(OPTION_KEYS) from None
