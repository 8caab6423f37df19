"""Parameters of the estimator, with PX4's names, units and meanings; defaults are those of this filter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from flightstack.params.spec import ParamSpec

GROUP = "EKF2"
_MS, _US = 1e-3, 1e-6
_STEP = math.sqrt(0.008)
"""From PX4's noise of a step of 8 ms to a density."""


class EstimatorParam(NamedTuple):
    """A parameter, and the field of the filter's parameters or GNSS limits that has its value times ``factor``."""

    spec: ParamSpec
    field: str
    factor: float = 1.0


def _param(
    name: str, default: float, low: float, high: float, unit: str, text: str, field: str, factor: float = 1.0,
    decimals: int = 3, integer: bool = False, group: str = GROUP,
) -> EstimatorParam:  # fmt: skip
    spec = ParamSpec(name, default, low, high, unit, text, integer, group, 0 if integer else decimals)
    return EstimatorParam(spec, field, factor)


ESTIMATOR_PARAMS = (
    _param("EKF2_PREDICT_US", 10000, 1000, 20000, "us",
           "Least time between two predictions; at least 1/48 of the longest delay", "period_s", _US, integer=True),
    _param("EKF2_TAU_VEL", 0.15, 0.0, 1.0, "s", "Time constant with which the output follows the filter; 0 at once",
           "output_s"),
    # control
    _param("IMU_GYRO_CUTOFF", 40.0, 0.0, 1000.0, "Hz", "Cutoff of the low-pass filter of the rates that the loops use;"
           " 0 for none", "gyro_cutoff_hz", 1.0, 1, group="Sensors"),
    _param("IMU_GYRO_RANGE", 2000.0, 100.0, 1e5, "deg/s", "Full scale of the gyro: a rate beyond it is not measured",
           "gyro_range_rad_s", math.radians(1.0), 1, group="Sensors"),
    _param("IMU_ACCEL_RANGE", 156.9, 10.0, 1e5, "m/s^2", "Full scale of the accelerometer: a specific force beyond it,"
           " as in an impact, is not measured", "accel_range_m_s2", 1.0, 1, group="Sensors"),
    # process
    _param("EKF2_GYR_NOISE", 0.005, 1e-4, 0.1, "rad/s", "Gyro noise for the prediction", "gyro_noise", _STEP, 4),
    _param("EKF2_ACC_NOISE", 0.35, 0.01, 1.0, "m/s^2", "Accelerometer noise for the prediction", "accel_noise", _STEP),
    _param("EKF2_GYR_B_NOISE", 0.0045, 0.0, 0.01, "rad/s^2", "Process noise of the gyro bias", "gyro_bias_walk", _STEP,
           4),
    _param("EKF2_ACC_B_NOISE", 0.011, 0.0, 0.1, "m/s^3", "Process noise of the accelerometer bias", "accel_bias_walk",
           _STEP),
    _param("EKF2_MAG_E_NOISE", 0.0011, 0.0, 0.1, "gauss/s", "Process noise of the Earth's magnetic field",
           "earth_field_walk", _STEP, 4),
    _param("EKF2_MAG_B_NOISE", 0.022, 0.0, 0.1, "gauss/s", "Process noise of the body's magnetic field",
           "body_field_walk", _STEP),
    _param("EKF2_WIND_NSD", 0.05, 0.0, 1.0, "m/s^2/sqrt(Hz)", "Process noise density of the wind", "wind_walk"),
    # initial uncertainty
    _param("EKF2_ANGERR_INIT", 0.05, 0.0, 0.5, "rad", "Initial uncertainty of tilt", "tilt_rad"),
    _param("EKF2_GBIAS_INIT", 0.02, 0.0, 0.2, "rad/s", "Initial uncertainty of the gyro bias", "gyro_bias_rad_s"),
    _param("EKF2_ABIAS_INIT", 0.05, 0.0, 0.5, "m/s^2", "Initial uncertainty of the accelerometer bias; along x and y"
           " it stays above 0.034, the gyro's alignment", "accel_bias_m_s2"),
    # GNSS
    _param("EKF2_GPS_DELAY", 110.0, 0.0, 300.0, "ms", "Delay of GNSS measurements", "gnss_delay_s", _MS, 1),
    _param("EKF2_GPS_V_NOISE", 0.05, 0.01, 5.0, "m/s", "Least noise of GNSS velocity", "gnss_velocity_noise_m_s"),
    _param("EKF2_GPS_P_NOISE", 0.1, 0.01, 10.0, "m", "Least noise of GNSS position", "gnss_position_noise_m"),
    _param("EKF2_GPS_V_GATE", 5.0, 1.0, 100.0, "SD", "Gate of GNSS velocity", "gnss_velocity_gate", 1.0, 1),
    _param("EKF2_GPS_P_GATE", 5.0, 1.0, 100.0, "SD", "Gate of GNSS position", "gnss_position_gate", 1.0, 1),
    # height
    _param("EKF2_BARO_DELAY", 0.0, 0.0, 300.0, "ms", "Delay of the barometer", "baro_delay_s", _MS, 1),
    _param("EKF2_BARO_NOISE", 0.05, 0.01, 15.0, "m", "Least noise of the barometer", "baro_noise_m"),
    _param("EKF2_BARO_GATE", 5.0, 1.0, 100.0, "SD", "Gate of the barometer", "baro_gate", 1.0, 1),
    _param("EKF2_RNG_DELAY", 5.0, 0.0, 300.0, "ms", "Delay of the rangefinder", "range_delay_s", _MS, 1),
    _param("EKF2_RNG_NOISE", 0.1, 0.01, 10.0, "m", "Least noise of the rangefinder", "range_noise_m"),
    _param("EKF2_RNG_GATE", 5.0, 1.0, 100.0, "SD", "Gate of the rangefinder", "range_gate", 1.0, 1),
    # drag, from which the wind is estimated
    _param("EKF2_DRAG_CTRL", 0, 0, 1, "", "Estimate the wind from the drag of a multirotor: 0 off, 1 on",
           "drag_is_fused", integer=True),
    _param("EKF2_DRAG_NOISE", 2.5, 0.05, 10.0, "(m/s^2)^2", "Variance of the drag", "drag_variance", 1.0, 2),
    _param("EKF2_BCOEF_X", 100.0, 0.0, 200.0, "kg/m^2", "Ballistic coefficient along x; 0 for no drag of the body",
           "ballistic_x_kg_m2", 1.0, 1),
    _param("EKF2_BCOEF_Y", 100.0, 0.0, 200.0, "kg/m^2", "The same along y", "ballistic_y_kg_m2", 1.0, 1),
    _param("EKF2_MCOEF", 0.15, 0.0, 1.0, "1/s", "Drag of the rotors' momentum, per m/s", "momentum_drag_1_s"),
    # magnetometer
    _param("EKF2_MAG_DELAY", 0.0, 0.0, 300.0, "ms", "Delay of the magnetometer", "mag_delay_s", _MS, 1),
    _param("EKF2_MAG_NOISE", 0.002, 0.0005, 1.0, "gauss", "Least noise of the magnetometer; it starts at 25 times"
           " that, at most 0.05", "mag_noise_gauss"),
    _param("EKF2_MAG_GATE", 3.0, 1.0, 100.0, "SD", "Gate of the magnetometer", "mag_gate", 1.0, 1),
    # first fix
    _param("EKF2_REQ_EPH", 3.0, 2.0, 100.0, "m", "Horizontal accuracy that the first fix needs; unknown counts as 5",
           "eph_m", 1.0, 1),
    _param("EKF2_REQ_EPV", 5.0, 2.0, 100.0, "m", "Vertical accuracy that the first fix needs; unknown counts as 8",
           "epv_m", 1.0, 1),
    _param("EKF2_REQ_SACC", 0.5, 0.1, 5.0, "m/s", "Accuracy of speed that the first fix needs; an unknown one,"
           " as of HIL_GPS, counts as 0.5", "speed_accuracy_m_s", 1.0, 2),
    _param("EKF2_REQ_NSATS", 6, 4, 12, "", "Satellites that the first fix needs", "satellites", integer=True),
)  # fmt: skip

MULTI_IMU = ParamSpec(
    "EKF2_MULTI_IMU", 3, 1, 3, "", "Largest number of inertial sensors that have an estimator of their own, of which"
    " the best one flies the vehicle", True, GROUP, 0, reboot_required=True,
)  # fmt: skip

ESTIMATOR_SPECS: Mapping[str, ParamSpec] = {
    **{param.spec.name: param.spec for param in ESTIMATOR_PARAMS},
    MULTI_IMU.name: MULTI_IMU,
}
"""Declarations by name."""

_DEFAULTS = {param.field: param.spec.default * param.factor for param in ESTIMATOR_PARAMS}
_HORIZON_STEPS, _HORIZON_MARGIN_S = 1.2, 0.012
"""Time by which the filter runs behind the latest measurement: its steps, and at least."""
_MEAN_AGE_S = 0.0225
"""Largest age of a mean of fast samples, over 45 ms, when the last of them arrives."""


def estimator_default(field: str) -> float:
    """Return the default of a field."""
    return _DEFAULTS[field]


def fields_of(values: Mapping[str, float]) -> dict[str, float]:
    """Return fields by name from parameters by name; other parameters are ignored."""
    return {
        param.field: values[param.spec.name] * param.factor
        for param in ESTIMATOR_PARAMS
        if param.spec.name in values
    }


def horizon_s(period_s: float, gnss_s: float, *averaged_s: float) -> float:
    """Return the delay of the filter with steps of ``period_s``, for the delays of GNSS and of averaged sensors."""
    return max(gnss_s, max(averaged_s) + _MEAN_AGE_S) + max(_HORIZON_STEPS * period_s, _HORIZON_MARGIN_S)
