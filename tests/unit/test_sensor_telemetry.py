"""Messages of a vehicle that flies on its sensors, against its samples and its estimator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import conjugate, quaternion_product, rotate, rotation_vector
from flightstack.estimation.error_state import ATTITUDE, POSITION, VELOCITY, read_nominal, turned
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.estimator_report import CONTROL, REJECTION, SOLUTION
from flightstack.estimation.health import STUCK_SAMPLES
from flightstack.estimation.imu_track import ImuTrack
from flightstack.estimation.motion_covariance import motion_covariance, pose_covariance, twist_covariance
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.sensor_samples import BaroSample, GnssFix, GnssSample, MagSample
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.services.telemetry.streams import Streams, default_rates_hz
from flightstack.services.telemetry.telemetry import SENSOR_STREAMED, STREAMED
from tests.support.flown_sensors import Faults
from tests.support.sensed_flight import sensed_after
from tests.support.telemetry_status import status, telemetry

SECONDS = 20.0
GOOD = (
    SOLUTION.ATTITUDE | SOLUTION.VELOCITY_HORIZONTAL | SOLUTION.VELOCITY_VERTICAL
    | SOLUTION.POSITION_RELATIVE | SOLUTION.POSITION_ABSOLUTE | SOLUTION.HEIGHT_ABSOLUTE
    | SOLUTION.PREDICTED_RELATIVE | SOLUTION.PREDICTED_ABSOLUTE
)  # fmt: skip


def flown_status(sensed: Sensed):
    return status(time_us=round(sensed.time_s * 1e6), sensed=sensed)


def sent(message_id: int, sensed: Sensed | None = None):
    """Return the messages of an id as a ground station decodes them."""
    shown = flown_status(sensed or sensed_after(SECONDS)[0])
    decoded = [
        m
        for message in telemetry(shown).messages(message_id)
        for m in Link(255, 190).decode(Link(1, 1).encode(message))
    ]
    assert all(message.get_msgId() == message_id for message in decoded)
    return decoded


def the(message_id: int, sensed: Sensed | None = None):
    (message,) = sent(message_id, sensed)
    return message


# ---------------------------------------------------------------------- report


def test_report_of_a_good_flight_has_good_flags() -> None:
    sensed = sensed_after(SECONDS)[0]
    report = sensed.report
    assert report.solution == GOOD
    in_use = (
        CONTROL.GNSS_POSITION | CONTROL.GNSS_VELOCITY | CONTROL.BARO_HEIGHT | CONTROL.MAG_3D
        | CONTROL.TILT_ALIGN | CONTROL.YAW_ALIGN | CONTROL.IN_AIR | CONTROL.GNSS_HEIGHT
    )  # fmt: skip
    assert report.control == in_use
    assert report.rejected == 0
    assert math.isnan(report.range_ratio)
    assert 0.0 < report.velocity_ratio < 1.0
    assert sensed.resets == 0


def test_report_before_alignment_has_no_flags() -> None:
    report = Sensed(Estimator().memory, NewestSamples()).report
    assert report.solution == 0
    assert report.control == 0


@pytest.mark.parametrize(
    ("without_s", "flags"),
    [(2.0, GOOD), (8.0, SOLUTION.ATTITUDE | SOLUTION.VELOCITY_VERTICAL | SOLUTION.HEIGHT_ABSOLUTE
                  | SOLUTION.CONSTANT_POSITION)],
)  # fmt: skip
def test_position_is_invalid_after_five_seconds_without_gnss(without_s: float, flags: int) -> None:
    faults = Faults(no_gnss_s=(SECONDS - without_s, math.inf))
    report = sensed_after(SECONDS, faults)[0].report
    assert report.solution == flags
    assert report.control & CONTROL.INERTIAL_DEAD_RECKONING
    assert not report.control & CONTROL.GNSS_POSITION


def test_dead_reckoning_grows_the_reported_uncertainty() -> None:
    lost = sensed_after(SECONDS, Faults(no_gnss_s=(SECONDS - 8.0, math.inf)))[0].report
    assert lost.horizontal_accuracy_m > 1.5 * sensed_after(SECONDS)[0].report.horizontal_accuracy_m


def test_jump_of_gnss_is_a_glitch_of_the_position() -> None:
    report = sensed_after(SECONDS, Faults(jump_s=(SECONDS - 1.0, math.inf), jump_m=30.0))[0].report
    assert report.rejected == REJECTION.POSITION_HORIZONTAL
    assert report.solution & SOLUTION.GNSS_GLITCH
    assert report.position_ratio > 1.0 > report.velocity_ratio


def test_disturbed_field_is_rejected_and_is_no_glitch() -> None:
    disturbed = Faults(disturbed_s=(SECONDS - 2.0, math.inf), disturbance_gauss=0.4)
    report = sensed_after(SECONDS, disturbed)[0].report
    assert report.rejected & REJECTION.MAG_X
    assert not report.solution & SOLUTION.GNSS_GLITCH
    assert report.field_ratio > 1.0


# ---------------------------------------------------------------------- covariances


def test_covariances_are_those_of_small_errors() -> None:
    """First order in the error: compare each jacobian with finite differences of the nominal state."""
    memory = sensed_after(SECONDS)[1].memory[0]
    n = read_nominal(memory["nominal"])
    attitude, force = n.attitude, Vector3(1.0, -2.0, -9.0)
    identity = {"covariance": np.diag([*[1.0] * 15, *[0.0] * 12])}

    def moved(error):
        q = turned(attitude, Vector3(*error[ATTITUDE : ATTITUDE + 3]))
        v = np.array(n.velocity_ned_m_s) + error[VELOCITY : VELOCITY + 3]
        p = np.array(n.position_ned_m) + error[POSITION : POSITION + 3]
        turn = rotation_vector(quaternion_product(conjugate(attitude), q))
        rates, f = -error[9:12], np.array(force) - error[12:15]
        body = rotate(conjugate(q), Vector3(*v))
        return [*p, *turn], [*body, *rates], [*p, *v, *rotate(q, Vector3(*f))]

    steps = [1e-6 * np.eye(15)[i] for i in range(15)]
    sides = [(moved(step), moved(-step)) for step in steps]
    covariances = (
        pose_covariance(identity, attitude),
        twist_covariance(identity, attitude, n.velocity_ned_m_s),
        motion_covariance(identity, attitude, force),
    )
    for kind, covariance in enumerate(covariances):
        jacobian = np.array([(np.array(a[kind]) - b[kind]) / 2e-6 for a, b in sides]).T
        assert covariance == pytest.approx(jacobian @ jacobian.T, abs=1e-6)


def test_odometry_has_the_estimators_covariances() -> None:
    _, estimator = sensed_after(SECONDS)
    m = the(mavlink.MAVLINK_MSG_ID_ODOMETRY)
    variances = estimator.deviations() ** 2
    assert [m.pose_covariance[at] for at in (0, 6, 11)] == pytest.approx(variances[6:9])
    assert sum(m.pose_covariance[at] for at in (15, 18, 20)) == pytest.approx(sum(variances[:3]))
    assert [m.velocity_covariance[at] for at in (15, 18, 20)] == pytest.approx(variances[9:12])
    assert (m.estimator_type, m.reset_counter) == (mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT, 0)
    assert all(map(math.isfinite, [*m.pose_covariance, *m.velocity_covariance]))


def test_local_position_covariance_has_45_elements_and_the_acceleration() -> None:
    m = the(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED_COV)
    variances = sensed_after(SECONDS)[1].deviations() ** 2
    assert [m.covariance[at] for at in (0, 9, 17)] == pytest.approx(variances[6:9])
    assert [m.covariance[at] for at in (24, 30, 35)] == pytest.approx(variances[3:6])
    assert all(m.covariance[at] > 0.0 for at in (39, 42, 44))
    s = flown_status(sensed_after(SECONDS)[0]).state
    force = np.array(sensed_after(SECONDS)[0].samples.imu.accel_frd_m_s2)
    force -= sensed_after(SECONDS)[0].nominal.accel_bias_m_s2
    up = rotate(Quaternion(*s[6:10]), Vector3(*force))
    assert (m.ax, m.ay, m.az) == pytest.approx((up.x, up.y, up.z + 9.80665), abs=1e-5)


# ---------------------------------------------------------------------- messages


def test_estimator_status_has_ratios_and_accuracies() -> None:
    report = sensed_after(SECONDS)[0].report
    m = the(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
    assert m.flags == GOOD
    assert (m.vel_ratio, m.pos_horiz_ratio) == pytest.approx((report.velocity_ratio, report.position_ratio))
    assert (m.pos_vert_ratio, m.mag_ratio) == pytest.approx((report.height_ratio, report.field_ratio))
    assert math.isnan(m.hagl_ratio)
    assert math.isnan(m.tas_ratio)
    assert m.pos_horiz_accuracy == pytest.approx(report.horizontal_accuracy_m)


def test_highres_imu_is_corrected_for_the_estimated_biases() -> None:
    sensed = sensed_after(SECONDS)[0]
    m, imu, bias = the(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU), sensed.samples.imu, sensed.nominal
    assert m.time_usec == 20_000_000
    assert (m.xacc, m.yacc, m.zacc) == pytest.approx(np.subtract(imu.accel_frd_m_s2, bias.accel_bias_m_s2))
    assert (m.xgyro, m.ygyro, m.zgyro) == pytest.approx(np.subtract(imu.gyro_frd_rad_s, bias.gyro_bias_rad_s))
    field = np.subtract(sensed.samples.mag.field_frd_gauss, bias.body_field_frd_gauss)
    assert (m.xmag, m.ymag, m.zmag) == pytest.approx(field)
    assert (m.abs_pressure, m.temperature) == pytest.approx((955.0, 20.0))
    assert m.fields_updated == 0x1FFF & ~mavlink.HIGHRES_IMU_UPDATED_DIFF_PRESSURE


def test_highres_imu_marks_silent_sensors() -> None:
    sensed = sensed_after(SECONDS)[0]
    old = sensed.samples.mag._replace(time_s=SECONDS - 0.2)
    shown = Sensed(sensed_after(SECONDS)[1].memory, NewestSamples(sensed.samples.imu_track, mag=old))
    assert the(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, shown).fields_updated == 0b111111


def test_scaled_imu_and_pressure_are_the_measured_ones() -> None:
    samples = sensed_after(SECONDS)[0].samples
    m = the(mavlink.MAVLINK_MSG_ID_SCALED_IMU)
    assert m.zacc == round(samples.imu.accel_frd_m_s2.z / 9.80665 * 1000)
    assert m.xgyro == round(samples.imu.gyro_frd_rad_s.x * 1000)
    assert m.ymag == round(samples.mag.field_frd_gauss.y * 1000)
    p = the(mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE)
    assert (p.press_abs, p.temperature, p.time_boot_ms) == (955.0, 2000, round(samples.baro.time_s * 1000))


def test_gps_raw_is_the_receivers_fix() -> None:
    gnss = sensed_after(SECONDS)[0].samples.gnss
    m = the(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert (m.fix_type, m.satellites_visible, m.time_usec) == (3, 14, round(gnss.time_s * 1e6))
    assert (m.lat, m.lon) == (round(gnss.latitude_deg * 1e7), round(gnss.longitude_deg * 1e7))
    assert (m.h_acc, m.v_acc, m.vel_acc) == (500, 800, 100)
    assert (m.eph, m.epv) == (0xFFFF, 0xFFFF)  # the receiver's accuracies are no dilutions of precision
    assert m.vel == round(math.hypot(*gnss.velocity_ned_m_s[:2]) * 100)


def test_gps_raw_of_a_silent_receiver_has_no_fix() -> None:
    m = the(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, sensed_after(SECONDS, Faults(no_gnss_s=(12.0, math.inf)))[0])
    assert (m.fix_type, m.satellites_visible, m.lat) == (mavlink.GPS_FIX_TYPE_NO_GPS, 0, 0)


IMU = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
BARO = mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE


def test_sys_status_has_the_health_of_each_sensor() -> None:
    healthy = the(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    gps, mag = mavlink.MAV_SYS_STATUS_SENSOR_GPS, mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    for bits in (gps, mag, mavlink.MAV_SYS_STATUS_AHRS, mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO):
        assert healthy.onboard_control_sensors_present & healthy.onboard_control_sensors_health & bits
    lost = the(
        mavlink.MAVLINK_MSG_ID_SYS_STATUS, sensed_after(SECONDS, Faults(no_gnss_s=(12.0, math.inf)))[0]
    )
    assert lost.onboard_control_sensors_present & gps
    assert not lost.onboard_control_sensors_health & gps
    assert lost.onboard_control_sensors_health & mag
    sensed, estimator = sensed_after(SECONDS)
    unfixed = sensed.samples.gnss._replace(fix_type=GnssFix.NO_FIX)
    without_fix = Sensed(estimator.memory, NewestSamples(sensed.samples.imu_track, gnss=unfixed))
    m = the(mavlink.MAVLINK_MSG_ID_SYS_STATUS, without_fix)
    assert not m.onboard_control_sensors_health & gps
    assert not m.onboard_control_sensors_present & mag


def silent_after(silent_s: float) -> Sensed:
    """Return what the vehicle knows ``silent_s`` after the last sample of any sensor."""
    sensed, estimator = sensed_after(SECONDS)
    return Sensed(estimator.memory, sensed.samples, time_s=SECONDS + silent_s)


def test_health_of_sensors_is_bad_after_the_imu_dies() -> None:
    healthy = the(mavlink.MAVLINK_MSG_ID_SYS_STATUS, silent_after(0.1)).onboard_control_sensors_health
    assert not healthy & (IMU | mavlink.MAV_SYS_STATUS_AHRS)
    assert healthy & BARO  # its last measurement is not yet old
    gps, mag = mavlink.MAV_SYS_STATUS_SENSOR_GPS, mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    m = the(mavlink.MAVLINK_MSG_ID_SYS_STATUS, silent_after(10.0))
    assert m.onboard_control_sensors_present & (IMU | BARO | gps | mag) == IMU | BARO | gps | mag
    assert not m.onboard_control_sensors_health & (IMU | BARO | gps | mag | mavlink.MAV_SYS_STATUS_AHRS)
    assert the(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, silent_after(10.0)).fix_type == mavlink.GPS_FIX_TYPE_NO_GPS


def test_health_of_sensors_is_bad_while_the_imu_is_frozen() -> None:
    sensed, estimator = sensed_after(SECONDS)
    frozen = NewestSamples(ImuTrack(), *(getattr(sensed.samples, name) for name in ("mag", "baro", "gnss")))
    for _ in range(STUCK_SAMPLES + 1):
        frozen.imu_track.take(*sensed.samples.imu)
    shown = Sensed(estimator.memory, frozen)
    healthy = the(mavlink.MAVLINK_MSG_ID_SYS_STATUS, shown).onboard_control_sensors_health
    assert not healthy & (IMU | mavlink.MAV_SYS_STATUS_AHRS)
    assert healthy & BARO
    assert not the(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, shown).flags & SOLUTION.ATTITUDE


def test_estimator_status_has_no_good_state_after_the_imu_dies() -> None:
    flags = the(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, silent_after(2.0)).flags
    assert flags & GOOD == GOOD & ~SOLUTION.ATTITUDE  # GNSS is accepted for the last time 2 s before
    assert the(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, silent_after(10.0)).flags & GOOD == 0


def test_highres_imu_of_a_dead_imu_marks_no_measurement() -> None:
    assert the(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, silent_after(1.0)).fields_updated == 0


def test_vibration_measures_change_from_sample_to_sample() -> None:
    size = 0.3
    track = ImuTrack()
    for i in range(250):  # the last 100 count
        track.take(0.004 * i, 0.004, (0.0, 0.0, 0.0), (size * (-1) ** i if i >= 150 else 0.0, 0.0, -9.81))
    found = Sensed(Estimator().memory, NewestSamples(track)).vibration
    assert found.accel_m_s2 == pytest.approx(2.0 * size)
    assert found.gyro_rad_s == found.coning_rad2 == 0.0
    single = ImuTrack()
    single.take(0.0, 0.004, (0.1, 0.0, 0.0), (0.0, 0.0, -9.81))
    assert Sensed(Estimator().memory, NewestSamples(single)).vibration == (0.0, 0.0, 0.0)
    m = the(mavlink.MAVLINK_MSG_ID_VIBRATION)
    assert m.vibration_z == pytest.approx(0.05 * math.sqrt(2.0) * 1.6, rel=0.2)  # noise of three axes
    assert (m.clipping_0, m.clipping_1, m.clipping_2) == (0, 0, 0)


def test_wind_is_sent_only_if_it_is_observed() -> None:
    assert sent(mavlink.MAVLINK_MSG_ID_WIND_COV) == []
    _, estimator = sensed_after(SECONDS)
    known = estimator.memory.copy()
    known["nominal"][0, 22:24] = 3.0, -4.0
    known["covariance"][0, 21, 21] = known["covariance"][0, 22, 22] = 0.04
    m = the(mavlink.MAVLINK_MSG_ID_WIND_COV, Sensed(known, sensed_after(SECONDS)[0].samples))
    assert (m.wind_x, m.wind_y) == (3.0, -4.0)
    assert (m.var_horiz, m.horiz_accuracy) == pytest.approx((0.08, math.sqrt(0.08)))


def test_nothing_is_sent_of_sensors_before_their_first_sample() -> None:
    empty = Sensed(Estimator().memory, NewestSamples())
    for message_id in (
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
        mavlink.MAVLINK_MSG_ID_WIND_COV,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED_COV,
    ):
        assert sent(message_id, empty) == []
    assert the(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, empty).fix_type == mavlink.GPS_FIX_TYPE_NO_GPS


@settings(max_examples=40)
@given(values=st.lists(st.floats(), min_size=13, max_size=13))
def test_messages_of_absurd_measurements_are_sent(values: list[float]) -> None:
    _, estimator = sensed_after(SECONDS)
    memory = estimator.memory.copy()
    memory["covariance"][0] = np.resize(values, (27, 27))
    for at, name in enumerate(("innovation", "variance", "test_ratio")):
        memory["observations"][0][name] = np.resize(np.roll(values, -at), len(memory["observations"][0]))
    memory["nominal"][0] = np.resize(values, 28)
    a, b = Vector3(*values[:3]), Vector3(*values[3:6])
    samples = NewestSamples(
        ImuTrack(), MagSample(20.0, a), BaroSample(20.0, *values[:3]),
        GnssSample(20.0, *values[:3], a, *values[3:6], 3, 12),
    )  # fmt: skip
    for _ in range(2):
        samples.imu_track.take(20.0, 0.004, a, b)
    shown = status(state=np.array(values), sensed=Sensed(memory, samples))
    told = telemetry(shown)
    for message_id in SENSOR_STREAMED:
        for message in told.messages(message_id):
            assert Link(1, 1).encode(message)


def test_places_on_earth_are_not_sent_before_the_first_fix() -> None:
    memory, samples = sensed_after(SECONDS)[1].memory, sensed_after(SECONDS)[0].samples
    for message_id in (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
    ):
        assert sent(message_id, Sensed(memory, samples, has_origin=False)) == []
        assert len(sent(message_id, Sensed(memory, samples))) == 1
    assert sent(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, Sensed(memory, samples, has_origin=False))


# ---------------------------------------------------------------------- streams


def test_sensor_messages_are_available_only_on_sensors() -> None:
    told = telemetry()
    for message_id in (mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, mavlink.MAVLINK_MSG_ID_VIBRATION):
        assert not told.is_available(message_id)
        assert Streams({}, STREAMED).interval_us(message_id) == 0
        assert not Streams({}).set_interval(message_id, 1e5)
        assert Streams({}, SENSOR_STREAMED).set_interval(message_id, 1e5)


@pytest.mark.parametrize("is_api", [False, True], ids=["ground", "api"])
def test_every_stream_of_sensors_is_available(is_api: bool) -> None:
    rates_hz = default_rates_hz(is_api, has_sensors=True)
    assert rates_hz.keys() <= SENSOR_STREAMED
    assert rates_hz.keys() > default_rates_hz(is_api, has_sensors=False).keys()


def test_only_companions_get_raw_imu_samples_by_default() -> None:
    raw = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
    assert default_rates_hz(is_api=True, has_sensors=True)[raw] == 50.0
    assert raw not in default_rates_hz(is_api=False, has_sensors=True)
