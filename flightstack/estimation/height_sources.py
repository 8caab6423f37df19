"""Height: the barometer and its bias, the range finder above level ground, and resets to GNSS."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import BARO_BIAS, ERROR_STATES, POSITION
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import LEAST_COS_TILT, cos_tilt_of, fuse_baro, fuse_range
from flightstack.estimation.kalman import BARO, GNSS_VELOCITY, RANGE, Filter
from flightstack.estimation.memory import MemoryRecord
from flightstack.estimation.resets import reset_position
from flightstack.estimation.source_checks import is_stuck, take_pressure_innovation

_AIDED_S = 1.0
_RANGE_LOST_S = 1.0
"""Time without an accepted distance after which the next one gives the height of the ground again."""


@compiled
def take_baro(m: MemoryRecord, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Fuse a pressure altitude. The first one, and the first after the barometer was stuck, gives its bias.

    So does one that follows a series of refused ones while GNSS velocity is accepted.
    """
    c = m["checks"]
    has_stopped = False
    if m["flags"]["landed"] == 0:
        has_stopped = is_stuck(c, row[1], row[0])
    if has_stopped:
        m["flags"]["has_baro"] = 0
        return
    last_s = f.observations[BARO]["fused_s"]
    speed_s = f.observations[GNSS_VELOCITY + 2]["fused_s"]
    if f.clock[0] - last_s > params.reset_s and f.clock[0] - speed_s < _AIDED_S:
        m["flags"]["has_baro"] = 0
    if m["flags"]["has_baro"] == 0:
        _start_baro(m, f, row[1], params)
    fuse_baro(f, row[1], f.clock[0] - row[0], params)
    take_pressure_innovation(c, f, row[0], row[1])


@compiled
def _start_baro(m: MemoryRecord, f: Filter, altitude_m: float, params: EstimatorParams) -> None:
    """Set the barometer's bias so that the first altitude agrees with the height."""
    p = f.covariance
    f.nominal[24] = altitude_m + f.nominal[9]
    at = POSITION + 2
    for j in range(at):
        p[j, BARO_BIAS] = p[j, at]
    for j in range(at, BARO_BIAS):
        p[j, BARO_BIAS] = p[at, j]
    for j in range(BARO_BIAS + 1, ERROR_STATES):
        p[BARO_BIAS, j] = p[at, j]
    p[BARO_BIAS, BARO_BIAS] = p[POSITION + 2, POSITION + 2] + params.baro_noise_m * params.baro_noise_m
    m["flags"]["has_baro"] = 1


@compiled
def take_range(m: MemoryRecord, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Fuse a distance. The first one, and the first after a loss, gives the height of the ground."""
    cos_tilt = cos_tilt_of(f)
    if cos_tilt < LEAST_COS_TILT:
        return
    if m["flags"]["has_range"] == 1 and f.clock[0] - f.observations[RANGE]["fused_s"] > _RANGE_LOST_S:
        m["flags"]["has_range"] = 0
    age_s = f.clock[0] - row[0]
    if m["flags"]["has_range"] == 0:
        m["ground_m"] = f.nominal[9] - age_s * f.nominal[6] + row[1] * cos_tilt
        m["flags"]["has_range"] = 1
    fuse_range(f, row[1] * cos_tilt, m["ground_m"], age_s, params)


@compiled
def reset_height(m: MemoryRecord, f: Filter, row: FloatArray) -> None:
    """Set the height to that of GNSS; barometer and range finder start again from it."""
    reset_position(m, f, row, 2, 1)
    m["flags"]["has_baro"], m["flags"]["has_range"] = 0, 0
