"""Parameters of the estimator: declared once, with PX4's names and units."""

from __future__ import annotations

import pytest

from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits, tuning_of
from flightstack.params.config import StackConfig
from flightstack.params.estimator import ESTIMATOR_PARAMS, ESTIMATOR_SPECS
from flightstack.vehicle.parameters import declared
from tests.support.truth import World


def test_defaults_of_parameters_are_those_of_the_filter() -> None:
    defaults = {name: spec.default for name, spec in ESTIMATOR_SPECS.items()}
    assert tuning_of(defaults) == tuning_of({}) == (EstimatorParams(), GnssLimits())


def test_each_parameter_sets_one_field_and_fits_its_range() -> None:
    fields = [param.field for param in ESTIMATOR_PARAMS]
    assert len(set(fields)) == len(fields)
    assert set(fields) < set(EstimatorParams._fields) | set(GnssLimits._fields)
    for name, spec in ESTIMATOR_SPECS.items():
        assert len(name) <= 16
        assert spec.accepted(spec.default) == spec.default


def test_delay_of_the_filter_follows_the_slowest_sensor() -> None:
    params, _ = tuning_of({"EKF2_GPS_DELAY": 200.0, "EKF2_BARO_DELAY": 100.0})
    assert params.gnss_delay_s == pytest.approx(0.2)
    assert params.delay_s == pytest.approx(0.212)
    params, _ = tuning_of({"EKF2_GPS_DELAY": 200.0, "EKF2_BARO_DELAY": 250.0})
    assert params.delay_s == pytest.approx(0.2845)  # the barometer's mean is up to 22.5 ms older
    params, _ = tuning_of({"EKF2_GPS_DELAY": 200.0, "EKF2_PREDICT_US": 20_000.0})
    assert params.delay_s == pytest.approx(0.224)


def test_period_of_the_filter_covers_the_delay_of_its_sensors() -> None:
    params, _ = tuning_of({"EKF2_PREDICT_US": 1000.0, "EKF2_GPS_DELAY": 300.0})
    assert params.period_s == pytest.approx(0.312 / 48)
    assert tuning_of({"EKF2_GPS_DELAY": 300.0})[0].period_s == pytest.approx(0.010)


def test_estimator_parameters_exist_on_a_vehicle_on_sensors_alone() -> None:
    for state, exists in (("estimated", True), ("truth", False)):
        names = {spec.name for spec in declared(StackConfig(state=state), ())}
        assert (set(ESTIMATOR_SPECS) <= names) is exists


def test_estimator_parameter_takes_effect_in_flight() -> None:
    with World(vehicle="x_quad", state="estimated", params={"EKF2_GPS_P_NOISE": 0.4}) as world:
        stack = world.engine.stack
        estimation = stack.estimation
        assert estimation is not None
        assert estimation.estimator.params.gnss_position_noise_m == pytest.approx(0.4)
        assert stack.params.set("EKF2_GPS_P_NOISE", 0.7) is None
        assert estimation.estimator.params.gnss_position_noise_m == pytest.approx(0.7)
        assert stack.params.set("EKF2_GPS_P_NOISE", 70.0) is not None
