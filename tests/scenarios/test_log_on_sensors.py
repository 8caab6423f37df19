"""The log of a vehicle on its sensors, as pyulog reads it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from flightstack.estimation.snapshot import ESTIMATOR_START
from flightstack.testing import World
from gcs_cli.estimate.result import OWN, TRUTH, estimate_log
from gcs_cli.logs.ulog_reader import read_ulog

TOPICS = {
    "sensor_combined": 500.0, "vehicle_magnetometer": 100.0, "vehicle_air_data": 50.0,
    "vehicle_gps_position": 10.0, "vehicle_attitude_groundtruth": 100.0,
    "vehicle_angular_velocity_groundtruth": 100.0, "vehicle_local_position_groundtruth": 100.0,
    "vehicle_global_position_groundtruth": 10.0, "estimator_status": 2.0, "estimator_status_flags": 2.0,
    "estimator_states": 2.0, "estimator_sensor_bias": 2.0, "estimator_innovations": 2.0,
    "estimator_innovation_variances": 2.0, "estimator_innovation_test_ratios": 2.0, "vehicle_imu_status": 2.0,
}  # fmt: skip
"""Rate [Hz] of each topic."""


@pytest.fixture(scope="module")
def content() -> Iterator[bytes]:
    with World(vehicle="x_quad", state="estimated", seed=4) as world:
        yield world.fly("hop").log.content


@pytest.fixture(scope="module")
def log(content: bytes) -> ULog:
    return ULog(io.BytesIO(content))


def topic(log: ULog, name: str) -> dict[str, Any]:
    data: dict[str, Any] = log.get_dataset(name).data
    return data


def at(log: ULog, times: Any, name: str, field: str) -> Any:
    data = topic(log, name)
    return np.interp(times, data["timestamp"], data[field])


@pytest.mark.parametrize(("name", "rate_hz"), TOPICS.items(), ids=TOPICS)
def test_topic_of_sensors_has_its_rate(log: ULog, name: str, rate_hz: float) -> None:
    times = topic(log, name)["timestamp"][1:] * 1e-6  # the first row is that of the log's begin
    assert (len(times) - 1) / (times[-1] - times[0]) == pytest.approx(rate_hz, rel=0.01)


def test_wind_and_distance_are_absent_without_measurements_of_them(log: ULog) -> None:
    assert {"wind", "distance_sensor"}.isdisjoint(data.name for data in log.data_list)


def test_truth_in_the_log_is_close_to_the_estimate(log: ULog) -> None:
    truth = topic(log, "vehicle_local_position_groundtruth")
    for field, limit in (("x", 2.0), ("y", 2.0), ("z", 2.5), ("vx", 0.3), ("vy", 0.3), ("vz", 0.3)):
        error = truth[field] - at(log, truth["timestamp"], "vehicle_local_position", field)
        assert np.sqrt(np.mean(error**2)) < limit  # measured: 0.4 m, 1.2 m, 0.04 m/s
        assert np.abs(error).max() > 0.0


def test_estimator_topics_agree_with_each_other(log: ULog) -> None:
    states, status = topic(log, "estimator_states"), topic(log, "estimator_status")
    flags, bias = topic(log, "estimator_status_flags"), topic(log, "estimator_sensor_bias")
    assert np.allclose(sum(states[f"states[{i}]"] ** 2 for i in range(4)), 1.0, atol=1e-6)
    accuracy = np.sqrt(states["covariances[6]"] + states["covariances[7]"])
    assert status["pos_horiz_accuracy"] == pytest.approx(accuracy, rel=1e-5)
    assert (bias["gyro_bias[1]"] == states["states[11]"]).all()
    for bit, field in ((0, "cs_tilt_align"), (2, "cs_gps"), (7, "cs_in_air"), (9, "cs_baro_hgt")):
        assert ((status["control_mode_flags"].astype(np.int64) >> bit & 1) == flags[field]).all()
    assert flags["cs_in_air"].any()
    assert not flags["cs_in_air"].all()
    ratios = topic(log, "estimator_innovation_test_ratios")
    innovations, variances = topic(log, "estimator_innovations"), topic(log, "estimator_innovation_variances")
    known = ratios["gps_vvel"] > 0.0
    gate = innovations["gps_vvel"][known] ** 2 / variances["gps_vvel"][known] / ratios["gps_vvel"][known]
    assert gate == pytest.approx(25.0, rel=1e-4)
    widened = innovations["baro_vpos"] ** 2 / variances["baro_vpos"] / ratios["baro_vpos"]
    assert (widened > 25.0 * (1.0 - 1e-4)).all()  # its errors are correlated
    assert np.isnan(innovations["airspeed"]).all()


def test_log_with_the_true_state_has_no_topics_of_sensors() -> None:
    with World(vehicle="x_quad", state="truth") as world:
        world.arm()
        world.run_for(0.5)
        names = {data.name for data in ULog(io.BytesIO(world.engine.newest_log())).data_list}
    assert names.isdisjoint(TOPICS)


def test_filter_repeats_the_flown_estimate_from_the_log(content: bytes) -> None:
    """Equal but for the single precision of the log, of GNSS velocities and of the estimate itself."""
    result = estimate_log(read_ulog(content, "hop"))
    assert set(result.others) == {OWN, TRUTH}
    flown = result.against[OWN]
    assert np.abs(flown.tilt_deg).max() < 1e-4  # measured: 3e-6°
    assert np.abs(flown.yaw_deg).max() < 1e-4
    assert np.abs(flown.velocity_m_s).max() < 1e-5
    assert np.abs(flown.position_m).max() < 1e-4


def test_filter_starts_anew_on_the_log_of_another_version(content: bytes) -> None:
    recording = read_ulog(content, "hop")
    assert ESTIMATOR_START not in ULog(io.BytesIO(content)).msg_info_dict  # ulog_info prints each of these
    assert ESTIMATOR_START not in recording.facts  # which exports and a run with --param use
    start = bytes(4) + recording.info[ESTIMATOR_START][4:]
    result = estimate_log(replace(recording, info={**recording.info, ESTIMATOR_START: start}))
    assert 0.01 < np.abs(result.against[OWN].yaw_deg).max() < 10.0
