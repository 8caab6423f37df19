"""An estimator and its sensors after a flight with truth in closed form."""

from __future__ import annotations

from functools import cache

from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import BaroSample, ImuSample, MagSample
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults

PARAMS = EstimatorParams()._replace(gnss_delay_s=flown.GNSS_DELAY_S, delay_s=flown.GNSS_DELAY_S + 0.012)
NO_FAULTS = Faults()


@cache
def sensed_after(seconds: float, faults: Faults = NO_FAULTS) -> tuple[Sensed, Estimator]:
    """Return what the vehicle knows ``seconds`` after the start, and its estimator."""
    estimator, samples = Estimator(PARAMS), NewestSamples()
    estimator.set_earth_field(flown.EARTH)
    for sample in flown.samples(seconds, faults):
        flown.feed(estimator, sample)
        if isinstance(sample, ImuSample):
            samples.imu_track.take(*sample)
        elif isinstance(sample, MagSample):
            samples.mag = sample
        elif isinstance(sample, BaroSample):
            samples.baro = sample
        else:
            samples.gnss = sample
    return Sensed(estimator.memory, samples), estimator
