"""Sensors of a vehicle: the optional table ``[sensors]`` of a vehicle file, and the grades with their sources.

``TABLES`` declares every number once: parser, record types of the simulator and docs/reference/sensors.md follow it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

from flightstack.params.toml_file import Table

CONSUMER, IDEAL, NONE = "consumer", "ideal", "none"
GRADES = (CONSUMER, IDEAL, NONE)
DEFAULT_GRADE = CONSUMER
OPTIONAL = ("range", "flow")
"""Sensors that a vehicle has only if its file names them."""
MAX_IMUS = 3
"""Number of inertial sensors that HIL_SENSOR can carry to PX4."""

Value: TypeAlias = float | tuple[float, ...]


class Number(NamedTuple):
    """One number of a sensor, with its allowed range and its value in each grade."""

    key: str
    unit: str
    meaning: str
    low: float
    high: float
    consumer: Value
    ideal: Value
    source: str = ""

    def default(self, grade: str) -> Value:
        """Return the value of a grade."""
        return self.ideal if grade == IDEAL else self.consumer


_CLASS = "class value"
_CALIBRATED = "class value after a calibration by the user"
_ICM = "ICM-20602 data sheet DS-000176"
_HMC = "HMC5883L data sheet"
_MS = "MS5611-01BA03 data sheet"
_GAZEBO = "Gazebo classic's plugin for PX4"
_GPS_SIM = "PX4's sensor_gps_sim"
_LL40LS = "PX4's driver ll40ls (LIDAR-Lite)"
_PAW = "PX4's driver paw3902, from the data sheet"
_HERE = (0.0, 0.0, 0.0)

_IMU = (
    Number("count", "", "inertial sensors, each with errors of its own", 1, MAX_IMUS, 1.0, 1.0),
    Number("position_frd_m", "m", "mounting, from the centre of gravity", -5.0, 5.0, _HERE, _HERE),
    Number("gyro_noise_deg_s_sqrt_hz", "°/s/√Hz", "noise density", 0.0, 10.0, 0.004, 0.0, _ICM),
    Number("accel_noise_m_s2_sqrt_hz", "m/s²/√Hz", "noise density", 0.0, 10.0, 9.8e-4, 0.0, f"{_ICM}: 100 µg/√Hz"),
    Number("gyro_bias_instability_deg_s", "°/s", "standard deviation of the bias that wanders", 0.0, 10.0, 0.003, 0.0,
           f"{_CLASS}: 10 °/h"),
    Number("accel_bias_instability_m_s2", "m/s²", "the same of the accelerometer", 0.0, 10.0, 4e-4, 0.0,
           f"{_CLASS}: 40 µg"),
    Number("bias_time_s", "s", "correlation time of both", 0.1, 1e5, 400.0, 400.0,
           f"{_CLASS}; {_GAZEBO} has 1000 s (gyro) and 300 s (accelerometer)"),
    Number("gyro_turn_on_bias_deg_s", "°/s", "standard deviation of the bias at switch-on", 0.0, 100.0, 0.2, 0.0,
           f"{_CLASS}; {_GAZEBO} has 0.5 °/s"),
    Number("accel_turn_on_bias_m_s2", "m/s²", "the same of the accelerometer", 0.0, 10.0, 0.03, 0.0,
           f"{_CALIBRATED}; {_GAZEBO} has 0.2 m/s² without one"),
    Number("gyro_scale_error", "", "standard deviation of the scale of each axis", 0.0, 0.2, 0.002, 0.0,
           f"{_CALIBRATED}; {_ICM}: ±1 % without one"),
    Number("accel_scale_error", "", "the same of the accelerometer", 0.0, 0.2, 0.002, 0.0, _CALIBRATED),
    Number("misalignment_deg", "°", "standard deviation of the angle of each axis", 0.0, 10.0, 0.2, 0.0, _CALIBRATED),
    Number("warm_up_k", "K", "rise of the temperature after switch-on", 0.0, 100.0, 15.0, 0.0, _CLASS),
    Number("warm_up_time_s", "s", "time constant of the rise", 1.0, 1e4, 300.0, 300.0, _CLASS),
    Number("gyro_temperature_deg_s_k", "°/s/K", "standard deviation of the bias per kelvin", 0.0, 1.0, 0.002, 0.0,
           f"{_CLASS} of a sensor that is calibrated over temperature"),
    Number("accel_temperature_m_s2_k", "m/s²/K", "the same of the accelerometer", 0.0, 1.0, 0.001, 0.0,
           f"{_CLASS} of a sensor that is calibrated over temperature"),
    Number("gyro_range_deg_s", "°/s", "full scale", 1.0, 1e6, 2000.0, 1e6, _ICM),
    Number("accel_range_m_s2", "m/s²", "full scale", 1.0, 1e6, 156.9064, 1e6, f"{_ICM}: 16 g"),
    Number("gyro_resolution_deg_s", "°/s", "step of the output, 0 for none", 0.0, 100.0, 0.06103515625, 0.0,
           f"{_ICM}: 16 bits"),
    Number("accel_resolution_m_s2", "m/s²", "step of the output, 0 for none", 0.0, 10.0, 0.00478840332, 0.0,
           f"{_ICM}: 16 bits; 2048 steps for 1 g in PX4's driver"),
    Number("rotor_imbalance_g_mm", "g mm", "of each rotor; its force shakes the vehicle", 0.0, 1e4, 1.0, 0.0,
           f"{_CLASS}: a propeller of 10 g with its centre of mass 0.1 mm off its axis"),
)  # fmt: skip

_MAG = (
    Number("rate_hz", "Hz", "rate", 1.0, 1000.0, 100.0, 100.0, _GAZEBO),
    Number("noise_gauss", "gauss", "standard deviation of a measurement", 0.0, 1.0, 0.002, 0.0,
           f"{_HMC}: 2 mG"),
    Number("hard_iron_gauss", "gauss", "standard deviation of the offset of each axis", 0.0, 10.0, 0.002, 0.0,
           _CALIBRATED),
    Number("soft_iron", "", "standard deviation of each term of the matrix of scale and coupling", 0.0, 0.5, 0.01, 0.0,
           _CALIBRATED),
    Number("current_gauss_a", "gauss/A", "standard deviation of the field of the current, each axis", 0.0, 1.0,
           0.0002, 0.0, f"{_CLASS} of a compass on a mast"),
    Number("range_gauss", "gauss", "full scale", 0.1, 1e3, 1.3, 1e3, f"{_HMC}: default gain, 1090 steps for 1 gauss"),
    Number("resolution_gauss", "gauss", "step of the output, 0 for none", 0.0, 1.0, 0.00092, 0.0,
           f"{_HMC}: default gain"),
)  # fmt: skip

_BARO = (
    Number("rate_hz", "Hz", "rate", 1.0, 1000.0, 50.0, 50.0, _GAZEBO),
    Number("noise_hpa", "hPa", "standard deviation of a measurement", 0.0, 100.0, 0.012, 0.0,
           f"{_MS}: resolution at an oversampling of 4096; {_GAZEBO} has 0.01 hPa"),
    Number("turn_on_offset_hpa", "hPa", "standard deviation of the offset", 0.0, 100.0, 0.5, 0.0,
           f"{_MS}: ±1.5 hPa"),
    Number("drift_hpa", "hPa", "standard deviation of the drift", 0.0, 100.0, 0.03, 0.0,
           f"{_CLASS}: 0.25 m by sun, self-heating and weather"),
    Number("drift_time_s", "s", "correlation time of the drift", 0.1, 1e6, 600.0, 600.0, _CLASS),
    Number("dynamic_share", "", "share of the dynamic pressure ½ρv² that the port feels", -2.0, 2.0, -0.05, 0.0,
           f"{_CLASS} of a port in foam; PX4's EKF2_PCOEF parameters correct it"),
    Number("ground_effect_share", "", "share of the disc loading that the port feels half a rotor radius high",
           -2.0, 2.0, 0.1, 0.0, "estimate"),
    Number("resolution_hpa", "hPa", "step of the output, 0 for none", 0.0, 10.0, 0.0, 0.0, f"{_MS}: 24 bits"),
)  # fmt: skip

_GNSS = (
    Number("rate_hz", "Hz", "rate", 0.5, 50.0, 10.0, 10.0, "PX4's driver ubx.cpp: 10 Hz by default, 5 Hz for an M8"),
    Number("latency_s", "s", "from the measurement to the message", 0.0, 2.0, 0.11, 0.0,
           "PX4's default of EKF2_GPS_DELAY; ArduPilot has 0.12 s for a u-blox M8, from flight logs"),
    Number("first_fix_s", "s", "time without a fix after switch-on", 0.0, 600.0, 1.0, 0.0, f"{_CLASS} of a hot start"),
    Number("horizontal_noise_m", "m", "standard deviation of the white noise, north and east", 0.0, 1e3, 0.1, 0.0,
           f"{_CLASS}; {_GPS_SIM} has 0.2 m and no drift"),
    Number("vertical_noise_m", "m", "the same, down", 0.0, 1e3, 0.2, 0.0, f"{_CLASS}; {_GPS_SIM} has 0.5 m"),
    Number("horizontal_drift_m", "m", "standard deviation of the correlated noise, north and east", 0.0, 1e4, 0.4, 0.0,
           f"{_CLASS} of the error that changes within minutes"),
    Number("vertical_drift_m", "m", "the same, down", 0.0, 1e4, 0.6, 0.0, _CLASS),
    Number("drift_time_s", "s", "correlation time of both", 0.1, 1e5, 60.0, 60.0,
           f"{_GAZEBO}: 30 s or 60 s by its version"),
    Number("velocity_noise_m_s", "m/s", "standard deviation, north and east", 0.0, 100.0, 0.05, 0.0,
           f"{_CLASS}; {_GPS_SIM} has 0.06 m/s and 0.077 m/s"),
    Number("vertical_velocity_noise_m_s", "m/s", "the same, down", 0.0, 100.0, 0.08, 0.0,
           f"{_CLASS}; {_GPS_SIM} has 0.158 m/s"),
    Number("satellites", "", "satellites in use", 0, 99, 14.0, 20.0, f"{_CLASS}; ArduPilot's simulator has 10"),
)  # fmt: skip

_RANGE = (
    Number("rate_hz", "Hz", "rate", 1.0, 1000.0, 50.0, 50.0, f"{_CLASS}; {_LL40LS} reads at 20 Hz"),
    Number("position_frd_m", "m", "mounting; it points along +z", -5.0, 5.0, _HERE, _HERE),
    Number("noise_m", "m", "standard deviation", 0.0, 10.0, 0.01, 0.0, _CLASS),
    Number("noise_share", "", "standard deviation over the distance", 0.0, 1.0, 0.01, 0.0, _CLASS),
    Number("min_m", "m", "shortest distance", 0.0, 100.0, 0.05, 0.0, _LL40LS),
    Number("max_m", "m", "longest distance", 0.1, 1e4, 40.0, 1e4, f"{_CLASS}; {_LL40LS} has 25 m or 35 m"),
    Number("resolution_m", "m", "step of the output, 0 for none", 0.0, 10.0, 0.01, 0.0, f"{_CLASS}, as the message"),
)  # fmt: skip

_FLOW = (
    Number("rate_hz", "Hz", "rate", 1.0, 1000.0, 50.0, 50.0, _CLASS),
    Number("noise_rad_s", "rad/s", "standard deviation", 0.0, 10.0, 0.05, 0.0, _CLASS),
    Number("max_rate_rad_s", "rad/s", "largest flow", 0.1, 1e3, 7.4, 1e3, _PAW),
    Number("min_height_m", "m", "height at which the lens begins to see", 0.0, 100.0, 0.08, 0.0, _PAW),
)  # fmt: skip

TABLES: Mapping[str, tuple[Number, ...]] = MappingProxyType(
    {"imu": _IMU, "mag": _MAG, "baro": _BARO, "gnss": _GNSS, "range": _RANGE, "flow": _FLOW}
)
"""The numbers of each sensor, by its table in the vehicle file."""

Numbers: TypeAlias = Mapping[str, Value]


@dataclass(frozen=True)
class Sensors:
    """Grade and numbers of a vehicle's sensors."""

    grade: str = NONE
    numbers: Mapping[str, Numbers] = field(default_factory=dict, hash=False)
    """The numbers of each sensor that the vehicle has, by the names of ``TABLES``."""

    @property
    def imu_count(self) -> int:
        """Number of inertial sensors."""
        count = self.numbers["imu"]["count"] if "imu" in self.numbers else 0.0
        assert isinstance(count, int | float)
        return int(count)


NO_SENSORS = Sensors()


def default_sensors(grade: str = DEFAULT_GRADE) -> Sensors:
    """Return the sensors of a grade."""
    if grade == NONE:
        return NO_SENSORS
    names = [name for name in TABLES if name not in OPTIONAL]
    return Sensors(grade, {name: {item.key: item.default(grade) for item in TABLES[name]} for name in names})


def read_sensors(top: Table) -> Sensors:
    """Read the table ``[sensors]``; without one the vehicle has those of the default grade. Raise ConfigError."""
    if not top.has("sensors"):
        return default_sensors()
    table = top.table("sensors")
    grade = table.choice("grade", GRADES) if table.has("grade") else DEFAULT_GRADE
    if grade == NONE:
        table.finish()
        return NO_SENSORS
    numbers: dict[str, Numbers] = {}
    for name, items in TABLES.items():
        if table.is_flag(name):
            if not table.flag(name, True):
                continue
            numbers[name] = {item.key: item.default(grade) for item in items}
        elif table.has(name) or name not in OPTIONAL:
            numbers[name] = _read_numbers(table.optional_table(name), items, grade)
    if "imu" not in numbers:
        raise table.error("imu", 'cannot be false: a vehicle without sensors has grade = "none"')
    table.finish()
    return Sensors(grade, numbers)


def _read_numbers(table: Table, items: tuple[Number, ...], grade: str) -> Numbers:
    numbers: dict[str, Value] = {}
    for item in items:
        default = item.default(grade)
        if isinstance(default, tuple):
            numbers[item.key] = table.numbers(item.key, len(default), item.low, item.high, default)
        else:
            numbers[item.key] = table.number(item.key, item.low, item.high, default)
    if "count" in numbers and not float(numbers["count"]).is_integer():  # type: ignore[arg-type]
        raise table.error("count", f"{numbers['count']:g} is not a whole number")
    if "min_m" in numbers and numbers["min_m"] >= numbers["max_m"]:  # type: ignore[operator]
        raise table.error("min_m", f"{numbers['min_m']:g} is not below max_m, {numbers['max_m']:g}")
    table.finish()
    return numbers
