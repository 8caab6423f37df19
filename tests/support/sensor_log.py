"""A ULog with the sensors of ``flown_sensors``, in the topics of an old or a new PX4, and with truth."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

from flightstack.estimation.sensor_samples import BaroSample, ImuSample, MagSample
from flightstack.flight_log import ulog
from tests.support import flown_sensors as flown
from tests.support.flown_sensors import Faults

_FORMATS = {"uint64_t": "Q", "float": "f", "double": "d", "int32_t": "i", "uint8_t": "B", "uint32_t": "I"}
_XYZ = [("float", 0, axis) for axis in ("x", "y", "z")]
_TOPICS: dict[str, list[tuple[str, int, str]]] = {
    "sensor_combined": [
        ("float", 3, "gyro_rad"), ("float", 3, "accelerometer_m_s2"), ("uint32_t", 0, "gyro_integral_dt"),
    ],
    "vehicle_magnetometer": [("float", 3, "magnetometer_ga")],
    "vehicle_air_data": [
        ("float", 0, "baro_alt_meter"), ("float", 0, "baro_pressure_pa"), ("float", 0, "baro_temp_celcius"),
    ],
    "vehicle_land_detected": [("uint8_t", 0, "landed")],
    "vehicle_attitude_groundtruth": [("float", 4, "q")],
    "vehicle_local_position_groundtruth": [
        *_XYZ, *(("float", 0, name) for name in ("vx", "vy", "vz")),
        ("double", 0, "ref_lat"), ("double", 0, "ref_lon"), ("float", 0, "ref_alt"),
    ],
}  # fmt: skip
_ACCURACY = [
    *(("float", 0, name) for name in ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s", "eph", "epv", "s_variance_m_s")),
    ("uint8_t", 0, "fix_type"), ("uint8_t", 0, "satellites_used"),
]  # fmt: skip
_PLACES = {
    False: [("int32_t", 0, name) for name in ("lat", "lon", "alt")],
    True: [("double", 0, name) for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")],
}


def sensor_log(seconds: float, *, new_names: bool = True) -> bytes:
    """Return the log; ``new_names``: GNSS fields as PX4 1.14 and later name them."""
    topics = {**_TOPICS, "vehicle_gps_position": [*_PLACES[new_names], *_ACCURACY]}
    parts = [ulog.file_header(0)]
    for name, fields in topics.items():
        parts.append(ulog.format_definition(name, [("uint64_t", 0, "timestamp"), *fields]))
    parts.append(ulog.parameter("EKF2_GPS_DELAY", flown.GNSS_DELAY_S * 1e3))
    ids = {name: number for number, name in enumerate(topics)}
    parts += [ulog.subscription(number, name) for name, number in ids.items()]
    for name, time_s, values in _rows(seconds, new_names):
        kinds = [kind for kind, length, _ in topics[name] for _ in range(max(1, length))]
        form = "<Q" + "".join(_FORMATS[kind] for kind in kinds)
        row = struct.pack(form, round(time_s * 1e6), *values)
        parts.append(ulog.DATA_HEADER.pack(len(row) + 2, ulog.DATA_TYPE, ids[name]) + row)
    return b"".join(parts)


def _rows(seconds: float, new_names: bool) -> Iterable[tuple[str, float, list[Any]]]:
    yield "vehicle_land_detected", 0.001, [1]
    yield "vehicle_land_detected", flown.STANDS_S, [0]
    for sample in flown.samples(seconds, Faults()):
        time_s = sample.time_s
        if isinstance(sample, ImuSample):
            values = [*sample.gyro_frd_rad_s, *sample.accel_frd_m_s2, round(sample.dt_s * 1e6)]
            yield "sensor_combined", time_s, values
            if round(time_s / flown.DT_S) % 5 == 0:
                yield "vehicle_attitude_groundtruth", time_s, list(flown.attitude(time_s))
                motion = [*flown.position(time_s), *flown.velocity(time_s), *flown.HOME]
                yield "vehicle_local_position_groundtruth", time_s, motion
        elif isinstance(sample, MagSample):
            yield "vehicle_magnetometer", time_s, list(sample.field_frd_gauss)
        elif isinstance(sample, BaroSample):
            values = [sample.pressure_altitude_m, sample.pressure_hpa * 100.0, sample.temperature_c]
            yield "vehicle_air_data", time_s, values
        else:
            place = [sample.latitude_deg, sample.longitude_deg, sample.altitude_msl_m]
            if not new_names:
                factors = (1e7, 1e7, 1e3)
                place = [round(value * factor) for value, factor in zip(place, factors, strict=True)]
            accuracy = [
                sample.eph_m,
                sample.epv_m,
                sample.speed_accuracy_m_s,
                sample.fix_type,
                sample.satellites,
            ]
            yield "vehicle_gps_position", time_s, [*place, *sample.velocity_ned_m_s, *accuracy]
