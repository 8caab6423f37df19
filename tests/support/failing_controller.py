"""An attitude controller whose law raises an error at a roll rate of 1 rad/s or more."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.control.control_law import AttitudeController, AttitudeInputs
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3


class OneFloat(NamedTuple):
    """Memory, and parameters."""

    value: float


@compiled
def step(memory: OneFloat, inputs: AttitudeInputs, params: OneFloat, dt_s: float) -> tuple[OneFloat, Vector3]:
    p = inputs.rates_frd_rad_s.x
    return OneFloat(memory.value + p), Vector3(math.log(params.value - p), 0.0, 0.0)


CONTROLLER = AttitudeController("failing", step, OneFloat, OneFloat, (0.0,), lambda vehicle, gains: (1.0,))
