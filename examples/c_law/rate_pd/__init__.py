"""An attitude law that exists in C: PD with a filter of the body rates."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from flightstack.control.control_law import CStep, c_law
from flightstack.params.toml_file import Table
from flightstack.params.tunable import Tunable
from flightstack.params.vehicle import Vehicle

FOLDER = Path(__file__).parent


class Params(NamedTuple):
    """Gains of angle [1/s²] and rate [1/s], time constant of the filter [s] and inertias."""

    angle_gain: float
    rate_gain: float
    filter_s: float
    ix_kg_m2: float
    iy_kg_m2: float
    iz_kg_m2: float


def read_params(vehicle: Vehicle, gains: Table) -> Params:
    """Read ``[attitude_rate-pd]``. Every key has a default."""
    params = Params(
        gains.number("angle_gain", 0.0, 1e4, 150.0),
        gains.number("rate_gain", 0.0, 1e3, 22.0),
        gains.number("filter_s", 0.0, 0.1, 0.002),
        *vehicle.inertia_kg_m2,
    )
    gains.finish()
    return params


STEP = CStep(FOLDER / "rate_pd.h", (FOLDER / "rate_pd.c",), "rate_pd_memory", "rate_pd_init", "rate_pd_step")
TUNABLES = (
    Tunable("angle_gain", "RPD_ANGLE", 0.0, 1e4, "1/s^2", "Acceleration per angle error"),
    Tunable("rate_gain", "RPD_RATE", 0.0, 1e3, "1/s", "Acceleration per rate error"),
)
CONTROLLER = c_law("rate-pd", STEP, Params, read_params, TUNABLES)
