"""Topics of the estimator, with PX4's names and fields, so that PX4's tools for its estimator read them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from flightstack.core.array_items import store
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import NOMINAL_SIZE, WIND, read_nominal
from flightstack.estimation.estimator_report import CONTROL, REJECTION, report_kernel
from flightstack.estimation.imu_track import TrackArray
from flightstack.estimation.kalman import BARO, GNSS_POSITION, GNSS_VELOCITY, MAG, OBSERVATIONS, RANGE
from flightstack.estimation.memory import MemoryArray, MemoryRecord
from flightstack.estimation.selector import SPEED_M_S, TURN_RAD, LaneReport
from flightstack.estimation.vibration import vibration_kernel
from flightstack.flight_log.local_position import count_of
from flightstack.flight_log.topics import Bit, Field, Group, Opposite, Topic

_DEVICE = 1
"""Device id of the sensors in use, as in the topics of the measurements."""


class ReportColumns(NamedTuple):
    """First column of each part of an estimator's row."""

    solution: int = 0
    control: int = 1
    rejected: int = 2
    accuracies: int = 3  # horizontal, vertical
    ratios: int = 5  # heading, velocity, position, height, height above ground
    resets: int = 10  # velocity, position, quaternion
    vibration: int = 13
    horizon_us: int = 16
    nominal: int = 17
    variances: int = 17 + NOMINAL_SIZE  # 24, of which the last, PX4's terrain, is zero
    innovations: int = 17 + NOMINAL_SIZE + 24
    innovation_variances: int = 17 + NOMINAL_SIZE + 24 + OBSERVATIONS
    squared_ratios: int = 17 + NOMINAL_SIZE + 24 + 2 * OBSERVATIONS
    size: int = 17 + NOMINAL_SIZE + 24 + 3 * OBSERVATIONS


AT = ReportColumns()
_STATES = 24
_KNOWN_VARIANCES = 23


_CONTROL: dict[str, int | None] = {
    "cs_tilt_align": CONTROL.TILT_ALIGN,
    "cs_yaw_align": CONTROL.YAW_ALIGN,
    "cs_gps": CONTROL.GNSS_POSITION,
    "cs_opt_flow": None,
    "cs_mag_hdg": None,
    "cs_mag_3d": CONTROL.MAG_3D,
    "cs_mag_dec": None,
    "cs_in_air": CONTROL.IN_AIR,
    "cs_wind": CONTROL.WIND,
    "cs_baro_hgt": CONTROL.BARO_HEIGHT,
    "cs_rng_hgt": CONTROL.RANGE_HEIGHT,
    "cs_gps_hgt": CONTROL.GNSS_HEIGHT,
    "cs_ev_pos": None,
    "cs_ev_yaw": None,
    "cs_ev_hgt": None,
    "cs_mag_fault": CONTROL.MAG_FAULT,
    "cs_vehicle_at_rest": CONTROL.VEHICLE_AT_REST,
    "cs_inertial_dead_reckoning": CONTROL.INERTIAL_DEAD_RECKONING,
    "cs_fake_pos": CONTROL.FAKE_POSITION,
    "cs_gnss_vel": CONTROL.GNSS_VELOCITY,
}
"""Fields of ``estimator_status_flags``; a sensor that the filter does not have is never in use."""
_FAULTS = (
    "fs_bad_mag_x", "fs_bad_mag_y", "fs_bad_mag_z", "fs_bad_hdg", "fs_bad_mag_decl", "fs_bad_airspeed",
    "fs_bad_sideslip", "fs_bad_optflow_x", "fs_bad_optflow_y", "fs_bad_acc_bias", "fs_bad_acc_vertical",
    "fs_bad_acc_clipping",
)  # fmt: skip
_REJECTED: dict[str, int | None] = {
    "reject_hor_vel": REJECTION.VELOCITY_HORIZONTAL,
    "reject_ver_vel": REJECTION.VELOCITY_VERTICAL,
    "reject_hor_pos": REJECTION.POSITION_HORIZONTAL,
    "reject_ver_pos": REJECTION.POSITION_VERTICAL,
    "reject_yaw": None,
    "reject_airspeed": None,
    "reject_sideslip": None,
    "reject_hagl": REJECTION.HEIGHT_ABOVE_GROUND,
    "reject_optflow_x": None,
    "reject_optflow_y": None,
}


def _flag_fields(column: int, flags: Mapping[str, int | None]) -> list[Field]:
    return [Field("bool", name, 0, Bit(column, flag or 0)) for name, flag in flags.items()]


_SAMPLE = Field("uint64_t", "timestamp_sample", 0, AT.horizon_us)


def _innovation_topic(name: str, first: int, default: float, is_signed: bool = False) -> Topic:
    """Return a topic of PX4's ``estimator_innovations`` kind, of values by row of the filter's observations.

    With ``is_signed``, innovations have PX4's sign: the prediction less the measurement, in the axis of the field,
    down for heights. The filter's are the measurement less the prediction, upwards for barometer and range.
    """

    def missing(field: str, length: int = 0) -> Field:
        return Field("float", field, length, default=default)

    def opposite(field: str, length: int, row: int) -> Field:
        return Field("float", field, length, Opposite(first + row) if is_signed else first + row)

    return Topic(
        name,
        (
            _SAMPLE,
            opposite("gps_hvel", 2, GNSS_VELOCITY),
            opposite("gps_vvel", 0, GNSS_VELOCITY + 2),
            opposite("gps_hpos", 2, GNSS_POSITION),
            opposite("gps_vpos", 0, GNSS_POSITION + 2),
            missing("ev_hvel", 2), missing("ev_vvel"), missing("ev_hpos", 2), missing("ev_vpos"),
            Field("float", "rng_vpos", 0, first + RANGE),
            Field("float", "baro_vpos", 0, first + BARO),
            missing("aux_hvel", 2), missing("aux_vvel"), missing("flow", 2), missing("terr_flow", 2),
            missing("heading"),
            opposite("mag_field", 3, MAG),
            missing("drag", 2), missing("airspeed"), missing("beta"),
            opposite("hagl", 0, RANGE),
            missing("hagl_rate"),
        ),
    )  # fmt: skip


ESTIMATOR = Group(
    "estimator",
    AT.size,
    (
        Topic(
            "estimator_status",
            (
                _SAMPLE,
                Field("uint64_t", "control_mode_flags", 0, AT.control),
                Field("float", "output_tracking_error", 3),  # the output follows the filter at once
                Field("uint32_t", "filter_fault_flags"),
                Field("float", "pos_horiz_accuracy", 0, AT.accuracies),
                Field("float", "pos_vert_accuracy", 0, AT.accuracies + 1),
                Field("float", "hdg_test_ratio", 0, AT.ratios),
                Field("float", "mag_test_ratio", 0, AT.ratios),
                Field("float", "vel_test_ratio", 0, AT.ratios + 1),
                Field("float", "pos_test_ratio", 0, AT.ratios + 2),
                Field("float", "hgt_test_ratio", 0, AT.ratios + 3),
                Field("float", "tas_test_ratio"),
                Field("float", "hagl_test_ratio", 0, AT.ratios + 4),
                Field("float", "beta_test_ratio"),
                Field("uint32_t", "accel_device_id", default=_DEVICE),
                Field("uint32_t", "gyro_device_id", default=_DEVICE),
                Field("uint32_t", "baro_device_id", default=_DEVICE),
                Field("uint32_t", "mag_device_id", default=_DEVICE),
                Field("uint16_t", "gps_check_fail_flags"),
                Field("uint16_t", "solution_status_flags", 0, AT.solution),
                Field("uint8_t", "reset_count_vel_ne", 0, AT.resets),
                Field("uint8_t", "reset_count_pos_ne", 0, AT.resets + 1),
                Field("uint8_t", "reset_count_quat", 0, AT.resets + 2),
            ),
        ),
        Topic(
            "estimator_status_flags",
            (
                _SAMPLE,
                *_flag_fields(AT.control, _CONTROL),
                *(Field("bool", name) for name in _FAULTS),
                *_flag_fields(AT.rejected, _REJECTED),
            ),
        ),
        Topic(
            "estimator_states",
            (
                _SAMPLE,
                Field("float", "states", _STATES, AT.nominal),
                Field("float", "covariances", _STATES, AT.variances),
                Field("uint8_t", "n_states", default=_STATES),
            ),
        ),
        Topic(
            "estimator_sensor_bias",
            (
                _SAMPLE,
                Field("uint32_t", "gyro_device_id", default=_DEVICE),
                Field("float", "gyro_bias", 3, AT.nominal + 10),
                Field("float", "gyro_bias_variance", 3, AT.variances + 9),
                Field("uint32_t", "accel_device_id", default=_DEVICE),
                Field("float", "accel_bias", 3, AT.nominal + 13),
                Field("float", "accel_bias_variance", 3, AT.variances + 12),
                Field("uint32_t", "mag_device_id", default=_DEVICE),
                Field("float", "mag_bias", 3, AT.nominal + 19),
                Field("float", "mag_bias_variance", 3, AT.variances + 18),
                Field("bool", "gyro_bias_valid", default=1),
                Field("bool", "accel_bias_valid", default=1),
                Field("bool", "mag_bias_valid", default=1),
            ),
        ),
        Topic(
            "vehicle_imu_status",
            (
                Field("uint32_t", "accel_device_id", default=_DEVICE),
                Field("uint32_t", "gyro_device_id", default=_DEVICE),
                Field("float", "accel_vibration_metric", 0, AT.vibration + 2),
                Field("float", "gyro_vibration_metric", 0, AT.vibration + 1),
                Field("float", "delta_angle_coning_metric", 0, AT.vibration),
            ),
        ),
        _innovation_topic("estimator_innovations", AT.innovations, math.nan, is_signed=True),
        _innovation_topic("estimator_innovation_variances", AT.innovation_variances, math.nan),
        _innovation_topic("estimator_innovation_test_ratios", AT.squared_ratios, math.nan),
    ),
)


WIND_GROUP = Group(
    "wind",
    5,
    (
        Topic(
            "wind",
            (
                Field("uint64_t", "timestamp_sample", 0, 0),
                Field("float", "windspeed_north", 0, 1),
                Field("float", "windspeed_east", 0, 2),
                Field("float", "variance_north", 0, 3),
                Field("float", "variance_east", 0, 4),
            ),
        ),
    ),
)


_MOST_LANES, _MOST_SENSORS = 9, 4
"""Sizes of the arrays in PX4's topic."""


class SelectorColumns(NamedTuple):
    """First column of each part of a selector's row."""

    changed_us: int = 0
    changes: int = 1
    selected: int = 2
    device: int = 3  # id of the selected inertial sensor: its number from 1
    available: int = 4
    faults: int = 5  # gyro, accelerometer
    ratios: int = 7
    relative: int = 7 + _MOST_LANES
    healthy: int = 7 + 2 * _MOST_LANES
    turns: int = 7 + 3 * _MOST_LANES
    speeds: int = 7 + 3 * _MOST_LANES + _MOST_SENSORS
    size: int = 7 + 3 * _MOST_LANES + 2 * _MOST_SENSORS


SELECT_AT = SelectorColumns()


SELECTOR_GROUP = Group(
    "selector",
    SELECT_AT.size,
    (
        Topic(
            "estimator_selector_status",
            (
                Field("uint64_t", "last_instance_change", 0, SELECT_AT.changed_us),
                Field("uint32_t", "instance_changed_count", 0, SELECT_AT.changes),
                Field("uint32_t", "accel_device_id", 0, SELECT_AT.device),
                Field("uint32_t", "baro_device_id", default=_DEVICE),
                Field("uint32_t", "gyro_device_id", 0, SELECT_AT.device),
                Field("uint32_t", "mag_device_id", default=_DEVICE),
                Field("float", "combined_test_ratio", _MOST_LANES, SELECT_AT.ratios),
                Field("float", "relative_test_ratio", _MOST_LANES, SELECT_AT.relative),
                Field("float", "accumulated_gyro_error", _MOST_SENSORS, SELECT_AT.turns),
                Field("float", "accumulated_accel_error", _MOST_SENSORS, SELECT_AT.speeds),
                Field("uint8_t", "primary_instance", 0, SELECT_AT.selected),
                Field("uint8_t", "instances_available", 0, SELECT_AT.available),
                Field("bool", "healthy", _MOST_LANES, SELECT_AT.healthy),
                Field("bool", "gyro_fault_detected", 0, SELECT_AT.faults),
                Field("bool", "accel_fault_detected", 0, SELECT_AT.faults + 1),
            ),
        ),
    ),
)
"""Of a vehicle with several inertial sensors; the estimators are PX4's instances."""


def fill_selector(row: FloatArray, report: LaneReport) -> None:
    """Fill a row of ``SELECTOR_GROUP``; estimators that the vehicle does not have are zero."""
    selection, facts, count = report.selection, report.facts, len(report.facts)
    records = selection.lanes
    row[:] = 0.0
    selected = selection.selected
    row[: SELECT_AT.faults] = _us(selection.changed_s), selection.changes, selected, selected + 1, count
    row[SELECT_AT.faults] = any(record.turn_rad >= TURN_RAD for record in records)
    row[SELECT_AT.faults + 1] = any(record.speed_m_s >= SPEED_M_S for record in records)
    for at, values in (
        (SELECT_AT.ratios, [lane.ratio for lane in facts]),
        (SELECT_AT.relative, [record.relative for record in records]),
        (SELECT_AT.healthy, [lane.is_usable for lane in facts]),
        (SELECT_AT.turns, [record.turn_rad for record in records]),
        (SELECT_AT.speeds, [record.speed_m_s for record in records]),
    ):
        row[at : at + count] = values


def _us(time_s: float) -> int:
    return max(0, round(time_s * 1e6))


@compiled
def _horizon_us(m: MemoryRecord) -> int:
    time_us: int = max(0, round(m["clock"][0] * 1e6))
    return time_us


@compiled
def store_estimator(
    memory: MemoryArray, track: TrackArray, time_s: float, row: FloatArray, wind: FloatArray
) -> int:
    """Fill a row of ``ESTIMATOR``, and ``wind``, one of ``WIND_GROUP``; return 1 if the wind is observed, else 0.

    ``track`` has the inertial samples, ``time_s`` is the time of the sensors.
    """
    report, m = report_kernel(memory, track, time_s), memory[0]
    vibration, has_range, resets = vibration_kernel(track), m["flags"]["has_range"] != 0, m["resets"]
    position, velocity, yaw = resets["position"], resets["velocity"], resets["yaw"]
    store(row, (
        report.solution, report.control, report.rejected,
        report.horizontal_accuracy_m, report.vertical_accuracy_m,
        report.field_ratio, report.velocity_ratio, report.position_ratio, report.height_ratio,
        report.range_ratio if has_range else 0.0,
        count_of(velocity["number"]), count_of(position["number"]), count_of(yaw["number"]),
        vibration.coning_rad2, vibration.gyro_rad_s, vibration.accel_m_s2, _horizon_us(m),
    ))  # fmt: skip
    x, p, observed = m["nominal"], m["covariance"], m["observations"]
    store(row[AT.nominal :], x)
    for i in range(_KNOWN_VARIANCES):
        row[AT.variances + i] = p[i, i]
    for i in range(OBSERVATIONS):
        row[AT.innovations + i] = observed[i]["innovation"]
        row[AT.innovations + OBSERVATIONS + i] = observed[i]["variance"]
        row[AT.innovations + 2 * OBSERVATIONS + i] = observed[i]["test_ratio"]
    n = read_nominal(x)
    store(wind, (_horizon_us(m), n.wind_north_m_s, n.wind_east_m_s, p[WIND, WIND], p[WIND + 1, WIND + 1]))
    return 1 if report.control & CONTROL.WIND != 0 else 0
