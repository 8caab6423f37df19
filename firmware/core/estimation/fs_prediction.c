/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Prediction of the filter's state and covariance with one accumulated IMU sample.
 * flightstack/estimation/prediction.py
 */
#include "fs_prediction.h"

#include "fs_derived_generated.h"
#include "fs_error_state.h"
#include "fs_geometry.h"
#include "fs_math.h"

#define FS_REMEMBERED_S FS_LIT(5.0)
#define FS_ATTITUDE 0
#define FS_VELOCITY 3
#define FS_POSITION 6
#define FS_GYRO_BIAS 9
#define FS_ACCEL_BIAS 12
#define FS_EARTH_FIELD 15
#define FS_BODY_FIELD 18
#define FS_WIND 21
#define FS_WIND_M_S FS_LIT(2.0)
#define FS_GUST_S FS_LIT(1.0)
#define FS_LEAST_S FS_LIT(0.001)
#define FS_MOST_PRESSURE FS_LIT(0.01)
#define FS_BARO_BIAS 23
#define FS_MOST_ANGLE FS_LIT(0.09)
#define FS_MOST_VELOCITY FS_LIT(25.0)

/* prediction.py:95 */
fs_motion fs_motion_of(const fs_nominal *n)
{
    return (fs_motion){n->attitude, n->velocity_ned_m_s, n->position_ned_m};
}

/* prediction.py:75 */
fs_vector3 fs_less_bias(const fs_vector3 *v, const fs_vector3 *bias, fs_real dt_s)
{
    return (fs_vector3){v->x - bias->x * dt_s, v->y - bias->y * dt_s, v->z - bias->z * dt_s};
}

/* prediction.py:81 */
fs_motion fs_moved(const fs_motion *start, const fs_vector3 *angle, const fs_vector3 *delta_velocity, fs_real dt_s,
                   fs_real gravity)
{
    const fs_vector3 dv = fs_rotate(&start->attitude, delta_velocity);
    const fs_vector3 *v = &start->velocity_ned_m_s;
    const fs_vector3 end = {v->x + dv.x, v->y + dv.y, v->z + dv.z + gravity * dt_s};
    const fs_vector3 *p = &start->position_ned_m;
    const fs_real half = FS_LIT(0.5) * dt_s;
    const fs_quaternion rotation_over = fs_rotation_over(angle, FS_LIT(1.0));
    const fs_quaternion quaternion_product = fs_quaternion_product(&start->attitude, &rotation_over);
    return (fs_motion){
        .attitude = fs_normalised(&quaternion_product),
        .velocity_ned_m_s = end,
        .position_ned_m = {
            .x = p->x + half * (v->x + end.x),
            .y = p->y + half * (v->y + end.y),
            .z = p->z + half * (v->z + end.z),
        },
    };
}

/* prediction.py:101 */
fs_nominal fs_with_motion(const fs_nominal *n, const fs_motion *motion)
{
    return (fs_nominal){
        .attitude = motion->attitude,
        .velocity_ned_m_s = motion->velocity_ned_m_s,
        .position_ned_m = motion->position_ned_m,
        .gyro_bias_rad_s = n->gyro_bias_rad_s,
        .accel_bias_m_s2 = n->accel_bias_m_s2,
        .earth_field_ned_gauss = n->earth_field_ned_gauss,
        .body_field_frd_gauss = n->body_field_frd_gauss,
        .wind_north_m_s = n->wind_north_m_s,
        .wind_east_m_s = n->wind_east_m_s,
        .baro_bias_m = n->baro_bias_m,
        .gnss_bias_ned_m = n->gnss_bias_ned_m,
    };
}

/* prediction.py:238 */
void fs_predict(fs_filter *f, const fs_delta_sample *sample, const fs_estimator_params *params)
{
    const fs_nominal n = fs_read_nominal(f->nominal);
    const fs_vector3 angle = fs_less_bias(&sample->angle_rad, &n.gyro_bias_rad_s, sample->dt_s);
    const fs_vector3 delta_velocity = fs_less_bias(&sample->velocity_m_s, &n.accel_bias_m_s2, sample->dt_s);
    const fs_quaternion rotation_over = fs_rotation_over(&angle, FS_LIT(0.5));
    const fs_quaternion middle = fs_quaternion_product(&n.attitude, &rotation_over);
    const fs_vector3 change = fs_rotate(&middle, &delta_velocity);
    f->behind[0] += sample->dt_s;
    const fs_vector3 read_vector = fs_read_vector(f->behind, 1);
    const fs_vector3 sum_of = fs_sum_of(&read_vector, &angle);
    fs_write_vector(f->behind, 1, &sum_of);
    const fs_vector3 read_vector_2 = fs_read_vector(f->behind, 4);
    const fs_vector3 sum_of_2 = fs_sum_of(&read_vector_2, &change);
    fs_write_vector(f->behind, 4, &sum_of_2);
    const fs_motion motion_of = fs_motion_of(&n);
    const fs_motion after = fs_moved(&motion_of, &angle, &delta_velocity, sample->dt_s, params->gravity_m_s2);
    const fs_nominal with_motion = fs_with_motion(&n, &after);
    fs_write_nominal(f->nominal, &with_motion);
    f->clock[0] = sample->time_s;
}

/*
 * Return the variances about the body's axes by errors of scale and alignment of the gyro in a step.
 *
 * An error e gives e phi after a rotation phi, and nothing any more after the rotation back. A process with the
 * deviation e phi, of the rotation of the last T, has noise of the density 2 (e phi)^2 / T. Rotation about the body's
 * z axis moves the tilt too, in step with the heading: _keep_misaligned counts that.
 *
 * prediction.py:136
 */
static fs_vector3 turn_variances(fs_filter *f, const fs_vector3 *angle, fs_real dt_s,
                                 const fs_estimator_params *params)
{
    const fs_real share = fs_min(dt_s / FS_REMEMBERED_S, FS_LIT(1.0));
    f->turn[0] += angle->x - share * f->turn[0];
    f->turn[1] += angle->y - share * f->turn[1];
    f->turn[2] += angle->z - share * f->turn[2];
    const fs_real density = FS_LIT(2.0) * params->gyro_scale_error * params->gyro_scale_error * share;
    const fs_real tilted = density * (f->turn[0] * f->turn[0] + f->turn[1] * f->turn[1]);
    return (fs_vector3){tilted, tilted, tilted + density * f->turn[2] * f->turn[2]};
}

/* Add the noise of one axis of the body, a unit vector in the world frame. prediction.py:125 */
static void add_body_noise(fs_real p[27][27], int32_t at, const fs_vector3 *axis, fs_real variance)
{
    p[at][at] += variance * axis->x * axis->x;
    p[at][at + 1] += variance * axis->x * axis->y;
    p[at][at + 2] += variance * axis->x * axis->z;
    p[at + 1][at + 1] += variance * axis->y * axis->y;
    p[at + 1][at + 2] += variance * axis->y * axis->z;
    p[at + 2][at + 2] += variance * axis->z * axis->z;
}

/* prediction.py:119 */
static void add(fs_real p[27][27], int32_t at, int32_t count, fs_real variance)
{
    for (int32_t i = at; i < at + count; i++) {
        p[i][i] += variance;
    }
}

/*
 * Keep a horizontal bias of the accelerometer as uncertain as the alignment of the gyro leaves it.
 *
 * A yaw rate omega measured along an axis that is off by e turns the tilt by e in step with the heading, which gives
 * the same velocity as a bias g e of the accelerometer. No other measurement tells them apart: what is added is a
 * bias along axis, a unit vector in the world frame, with the tilt that hides it from the velocity of level flight.
 *
 * prediction.py:153
 */
static void keep_misaligned(fs_real p[27][27], int32_t at, const fs_vector3 *axis, const fs_estimator_params *params)
{
    const fs_real gravity = params->gravity_m_s2;
    const fs_real bias = gravity * params->gyro_scale_error;
    const fs_real lacking = fs_max(bias * bias - p[at][at], FS_LIT(0.0));
    const fs_real about_north = axis->y / gravity;
    const fs_real about_east = -axis->x / gravity;
    p[FS_ATTITUDE][FS_ATTITUDE] += lacking * about_north * about_north;
    p[FS_ATTITUDE][FS_ATTITUDE + 1] += lacking * about_north * about_east;
    p[FS_ATTITUDE + 1][FS_ATTITUDE + 1] += lacking * about_east * about_east;
    p[FS_ATTITUDE][at] += lacking * about_north;
    p[FS_ATTITUDE + 1][at] += lacking * about_east;
    p[at][at] += lacking;
}

/*
 * Keep the accelerometer's vertical bias as uncertain as the alignment of its axes leaves it.
 *
 * Drag d along the body shows in a vertical axis that is off by e as a bias of d e. A filter that learns it holds it
 * for the sensor's own, so that the variance stays that of both: 2 (d e)^2, with the mean drag of the last T. force
 * is the velocity change in the body frame.
 *
 * prediction.py:173
 */
static void keep_inclined(fs_filter *f, const fs_vector3 *force, fs_real dt_s, const fs_estimator_params *params)
{
    const fs_real share = fs_min(dt_s / FS_REMEMBERED_S, FS_LIT(1.0));
    f->drag[0] += force->x / FS_REMEMBERED_S - share * f->drag[0];
    f->drag[1] += force->y / FS_REMEMBERED_S - share * f->drag[1];
    const fs_real square = params->gyro_scale_error * params->gyro_scale_error *
                           (f->drag[0] * f->drag[0] + f->drag[1] * f->drag[1]);
    f->covariance[FS_ACCEL_BIAS + 2][FS_ACCEL_BIAS + 2] =
                                                          fs_max(f->covariance[FS_ACCEL_BIAS + 2][FS_ACCEL_BIAS + 2],
            FS_LIT(2.0) * square);
}

/*
 * Return the variance that a change of the airspeed in a step adds to the barometer's bias.
 *
 * The port feels a share of the dynamic pressure: an altitude of share u^2 / 2 g for the airspeed u, which changes by
 * share u du / g, as white noise. The wind is not known.
 *
 * prediction.py:188
 */
static fs_real pressure_variance(const fs_filter *f, const fs_vector3 *change, fs_real dt_s,
                                 const fs_estimator_params *params)
{
    const fs_real north = f->nominal[4];
    const fs_real east = f->nominal[5];
    const fs_real square = north * north + east * east + FS_WIND_M_S * FS_WIND_M_S;
    const fs_real share = params->baro_dynamic_share / params->gravity_m_s2;
    const fs_real lasting = FS_GUST_S / fs_max(dt_s, FS_LEAST_S);
    const fs_real variance = share * share * square * (change->x * change->x + change->y * change->y) * lasting;
    return fs_min(variance, FS_MOST_PRESSURE);
}

/* prediction.py:202 */
static void add_process_noise(fs_filter *f, const fs_quaternion *q, const fs_vector3 *angle, const fs_vector3 *change,
                              const fs_vector3 *force, fs_real dt_s, const fs_imu_noise *noise,
                              const fs_estimator_params *params)
{
    const fs_real share = f->clock[1];
    const fs_real gyro = params->gyro_noise;
    const fs_real accel = params->accel_noise;
    const fs_vector3 v = {FS_LIT(1.0), FS_LIT(0.0), FS_LIT(0.0)};
    const fs_vector3 x = fs_rotate(q, &v);
    const fs_vector3 v_2 = {FS_LIT(0.0), FS_LIT(1.0), FS_LIT(0.0)};
    const fs_vector3 y = fs_rotate(q, &v_2);
    const fs_vector3 z = fs_cross(&x, &y);
    const fs_vector3 turns = turn_variances(f, angle, dt_s, params);
    add_body_noise(f->covariance, FS_ATTITUDE, &x, turns.x + fs_max(gyro * gyro, share * noise->gyro.x) * dt_s);
    add_body_noise(f->covariance, FS_ATTITUDE, &y, turns.y + fs_max(gyro * gyro, share * noise->gyro.y) * dt_s);
    add_body_noise(f->covariance, FS_ATTITUDE, &z, turns.z + fs_max(gyro * gyro, share * noise->gyro.z) * dt_s);
    add_body_noise(f->covariance, FS_VELOCITY, &x, fs_max(accel * accel, share * noise->accel.x) * dt_s);
    add_body_noise(f->covariance, FS_VELOCITY, &y, fs_max(accel * accel, share * noise->accel.y) * dt_s);
    add_body_noise(f->covariance, FS_VELOCITY, &z, fs_max(accel * accel, share * noise->accel.z) * dt_s);
    add(f->covariance, FS_POSITION, 3, FS_LIT(1e-08) * dt_s);
    add(f->covariance, FS_GYRO_BIAS, 3, params->gyro_bias_walk * params->gyro_bias_walk * dt_s);
    add(f->covariance, FS_ACCEL_BIAS, 3, params->accel_bias_walk * params->accel_bias_walk * dt_s);
    keep_misaligned(f->covariance, FS_ACCEL_BIAS, &x, params);
    keep_misaligned(f->covariance, FS_ACCEL_BIAS + 1, &y, params);
    keep_inclined(f, force, dt_s, params);
    add(f->covariance, FS_EARTH_FIELD, 3, params->earth_field_walk * params->earth_field_walk * dt_s);
    add(f->covariance, FS_BODY_FIELD, 3, params->body_field_walk * params->body_field_walk * dt_s);
    add(f->covariance, FS_WIND, 2, params->wind_walk * params->wind_walk * dt_s);
    const fs_real pressure = pressure_variance(f, change, dt_s, params);
    add(f->covariance, FS_BARO_BIAS, 1, params->baro_walk * params->baro_walk * dt_s + pressure);
}

/* prediction.py:254 */
void fs_predict_errors(fs_filter *f, const fs_imu_noise *noise, const fs_estimator_params *params)
{
    const fs_real dt_s = f->behind[0];
    const fs_vector3 angle = fs_read_vector(f->behind, 1);
    const fs_vector3 change = fs_read_vector(f->behind, 4);
    const fs_quaternion attitude = {
        .w = f->nominal[0],
        .x = f->nominal[1],
        .y = f->nominal[2],
        .z = f->nominal[3],
    };
    const fs_quaternion rotation_over = fs_rotation_over(&angle, FS_LIT(-0.5));
    const fs_quaternion middle = fs_quaternion_product(&attitude, &rotation_over);
    const fs_quaternion conjugate = fs_conjugate(&middle);
    const fs_vector3 force = fs_rotate(&conjugate, &change);
    fs_predict_covariance(f->covariance, &middle, &force, dt_s);
    add_process_noise(f, &middle, &angle, &change, &force, dt_s, noise, params);
    for (int32_t i = 0; i < 7; i++) {
        f->behind[i] = FS_LIT(0.0);
    }
}

/* prediction.py:270 */
void fs_add_unknown(fs_filter *f, const fs_delta_sample *step)
{
    const fs_real half_s = FS_LIT(0.5) * step->dt_s;
    for (int32_t axis = 0; axis < 3; axis++) {
        const int32_t turn = FS_ATTITUDE + axis;
        const int32_t speed = FS_VELOCITY + axis;
        const int32_t place = FS_POSITION + axis;
        f->covariance[turn][turn] += fs_min(step->unknown_angle,
                                            fs_max(FS_MOST_ANGLE - f->covariance[turn][turn], FS_LIT(0.0)));
        const fs_real variance = fs_min(step->unknown_velocity,
                                        fs_max(FS_MOST_VELOCITY - f->covariance[speed][speed], FS_LIT(0.0)));
        f->covariance[speed][speed] += variance;
        f->covariance[speed][place] += half_s * variance;
        f->covariance[place][place] += half_s * half_s * variance;
    }
}
