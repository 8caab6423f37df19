"""The memory of one estimator: a record."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.array_items import as_tuple
from flightstack.core.compiled import compiled
from flightstack.core.contract import STATE_SIZE, FloatArray, Record, RecordArray
from flightstack.core.record_types import dtype_of
from flightstack.estimation.alignment import Alignment
from flightstack.estimation.estimator_params import PARAMS_SIZE, EstimatorParams
from flightstack.estimation.imu_input import ImuSums
from flightstack.estimation.kalman import Filter
from flightstack.estimation.rate_filter import RateFilter
from flightstack.estimation.rings import RINGS, TRACK_COLUMNS, Mean, Rings
from flightstack.estimation.source_checks import Checks
from flightstack.estimation.yaw_estimator import YawBank

NOTHING = -1
"""Returned by a source without a measurement that is due; else it returns its next axis, 0 after the last one."""


class Flags(NamedTuple):
    """What the estimator knows, 1 if it is true."""

    aligned: int
    landed: int
    has_baro: int
    has_gnss: int
    has_range: int
    has_mag: int
    has_yaw: int
    """The yaw is known, from the magnetometer or from GNSS velocity."""
    mag_fault: int
    """GNSS velocity has disproved the yaw of the magnetometer, which is not used any more."""
    field_is_new: int
    """The filter has not yet been corrected with the Earth's field."""


class Gaps(NamedTuple):
    """Time without samples of the IMU in all, and the number of such gaps."""

    total_s: float
    number: float


class Hold(NamedTuple):
    """Horizontal position that is held."""

    place_m: Annotated[FloatArray, 2]
    """North, east."""
    fused_s: float
    """Time of the last fusion, 0 if nothing is held."""


class YawFix(NamedTuple):
    """Comparison of the filter's yaw with that of GNSS velocity."""

    turn_rad: float
    """From the filter's yaw to that of GNSS velocity."""
    variance: float
    updates: float
    wrong_s: float
    """Time since which they contradict each other, 0 if they do not."""


class Agenda(NamedTuple):
    """The open step."""

    source: int
    """The source that is at work, 0 if no step is open."""
    axis: int
    """The next one of the source."""
    has_fused: int
    """1 if a measurement was fused in the step."""


class BeforeGnss(NamedTuple):
    """The state before the measurement of GNSS that is being fused."""

    elapsed_s: float
    """Since the last measurement."""
    outage_s: float
    """Since the last accepted position."""
    place_m: Annotated[FloatArray, 2]
    """North, east; the velocity too."""
    velocity_m_s: Annotated[FloatArray, 2]


class Reset(NamedTuple):
    """Resets of position or velocity, NED."""

    number: float
    change: Annotated[FloatArray, 3]
    """In the last step with one."""
    sum: Annotated[FloatArray, 3]
    """Of all changes."""
    time_s: float
    """Of the last step with one."""


class YawReset(NamedTuple):
    """Resets of the yaw: their number, the last change, and the sum of all."""

    number: float
    change_rad: float
    sum_rad: float


class Resets(NamedTuple):
    """Resets of each kind."""

    position: Annotated[Record, Reset]
    velocity: Annotated[Record, Reset]
    yaw: Annotated[Record, YawReset]


class EstimatorMemory(NamedTuple):
    """Parameters, state and waiting measurements of an estimator.

    What each sample needs comes first, as in ``Filter``: a target then has 5 % fewer instructions.
    """

    output: Annotated[FloatArray, TRACK_COLUMNS]
    state: Annotated[FloatArray, STATE_SIZE]
    """The output as ``VehicleState``."""
    last_imu_s: float
    gaps: Annotated[Record, Gaps]
    last_gnss_s: float
    gnss_speed_m_s: Annotated[FloatArray, 2]
    """North, east, smoothed."""
    refused_s: Annotated[FloatArray, 6]
    """Time of refused GNSS velocities and positions, without an accepted one."""
    ground_m: float
    hold: Annotated[Record, Hold]
    rest_s: float
    """Time of the last fusion at rest."""
    drag_s: float
    """Time of the last fusion of drag."""
    flags: Annotated[Record, Flags]
    yaw_fix: Annotated[Record, YawFix]
    followed: float
    """Number of resets that the output has followed."""
    agenda: Annotated[Record, Agenda]
    pending: Annotated[FloatArray, 10]
    """The measurement that is being fused, a row of its ring."""
    filter: Filter
    params: EstimatorParams
    sums: Annotated[Record, ImuSums]
    means: Annotated[RecordArray, Mean, RINGS]
    checks: Annotated[Record, Checks]
    alignment: Annotated[Record, Alignment]
    resets: Annotated[Record, Resets]
    rate_filter: Annotated[Record, RateFilter]
    earth: Annotated[FloatArray, 4]
    """Field NED [gauss], declination [rad], NaN if unknown."""
    field: Annotated[FloatArray, 3]
    """Of the body [gauss], the last one at the horizon."""
    before_gnss: Annotated[Record, BeforeGnss]
    yaw_bank: Annotated[Record, YawBank]
    rings: Rings


MEMORY = dtype_of(EstimatorMemory)
MemoryRecord: TypeAlias = Annotated[Record, EstimatorMemory]
"""One record of ``MEMORY``."""
ResetRecord: TypeAlias = Annotated[Record, Reset]
MemoryArray: TypeAlias = Annotated[RecordArray, EstimatorMemory]
"""An array of one such record, shape (1,)."""


@compiled
def start_memory(memory: MemoryArray) -> None:
    """Set what is not zero at the start in a memory of zeros that has its parameters."""
    m = memory[0]
    params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
    m["sums"]["rotation"][0] = 1.0
    m["clock"][1] = params.imu_noise_share
    m["earth"][3] = math.nan


@compiled
def filter_of(m: MemoryRecord) -> Filter:
    """Return the filter's arrays of a record of ``MEMORY``."""
    return Filter(
        m["nominal"],
        m["h"],
        m["ph"],
        m["gain"],
        m["clock"],
        m["behind"],
        m["turn"],
        m["drag"],
        m["covariance"],
        m["observations"],
    )


@compiled
def rings_of(m: MemoryRecord) -> Rings:
    """Return the ring buffers of a record of ``MEMORY``."""
    return Rings(m["gnss"], m["mag"], m["baro"], m["range"], m["imu"], m["track"], m["cursors"])
