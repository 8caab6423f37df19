/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Initial state: tilt from the specific force, yaw from the magnetometer, biases zero; and resets to measurements.
 * flightstack/estimation/alignment.py
 */
#include "fs_alignment.h"

#include "fs_error_state.h"
#include "fs_estimation_geometry.h"
#include "fs_estimation_math.h"
#include "fs_fusion.h"
#include "fs_geometry.h"
#include "fs_kalman.h"
#include "fs_math.h"

#define FS_ALIGNMENT_S FS_LIT(0.4)
#define FS_WAIT_FOR_MAG_S FS_LIT(2.0)
#define FS_ERROR_STATES 27
#define FS_ATTITUDE 0
#define FS_ANY_YAW_RAD FS_LIT(1.8)
#define FS_VELOCITY 3
#define FS_POSITION 6
#define FS_GYRO_BIAS 9
#define FS_ACCEL_BIAS 12
#define FS_WIND 21
#define FS_BARO_BIAS 23
#define FS_GNSS_BIAS 24
#define FS_UNKNOWN_YAW_RAD FS_LIT(1.0)
#define FS_EARTH_FIELD 15
#define FS_BODY_FIELD 18

/* alignment.py:67 */
void fs_add_field(fs_alignment *sums, const fs_vector3 *field)
{
    sums->field[0] += field->x;
    sums->field[1] += field->y;
    sums->field[2] += field->z;
    sums->fields += FS_LIT(1.0);
}

/* alignment.py:55 */
bool fs_add_force(fs_alignment *sums, const fs_vector3 *force, fs_real dt_s)
{
    sums->force[0] += force->x;
    sums->force[1] += force->y;
    sums->force[2] += force->z;
    sums->forces += FS_LIT(1.0);
    sums->elapsed_s += dt_s;
    const fs_real elapsed_s = sums->elapsed_s;
    return elapsed_s >= FS_ALIGNMENT_S && (sums->fields > FS_LIT(0.0) || elapsed_s >= FS_WAIT_FOR_MAG_S);
}

/* alignment.py:84 */
void fs_set_initial_variances(fs_filter *f, const fs_estimator_params *params, fs_real speed_m_s, fs_real tilt_rad)
{
    fs_reset_variance(f->covariance, 0, FS_ERROR_STATES, FS_LIT(1e-08));
    fs_reset_variance(f->covariance, FS_ATTITUDE, 2, tilt_rad * tilt_rad);
    fs_reset_variance(f->covariance, FS_ATTITUDE + 2, 1, FS_ANY_YAW_RAD * FS_ANY_YAW_RAD);
    fs_reset_variance(f->covariance, FS_VELOCITY, 3, speed_m_s * speed_m_s);
    fs_reset_variance(f->covariance, FS_POSITION, 3, FS_LIT(0.0001));
    fs_reset_variance(f->covariance, FS_GYRO_BIAS, 3, params->gyro_bias_rad_s * params->gyro_bias_rad_s);
    fs_reset_variance(f->covariance, FS_ACCEL_BIAS, 3, params->accel_bias_m_s2 * params->accel_bias_m_s2);
    fs_reset_variance(f->covariance, FS_WIND, 2, params->wind_m_s * params->wind_m_s);
    fs_reset_variance(f->covariance, FS_BARO_BIAS, 1, FS_LIT(10000.0));
    fs_reset_variance(f->covariance, FS_GNSS_BIAS, 3, FS_LIT(1e-08));
}

/* alignment.py:126 */
static void set_attitude(fs_filter *f, const fs_quaternion *q)
{
    f->nominal[0] = q->w;
    f->nominal[1] = q->x;
    f->nominal[2] = q->y;
    f->nominal[3] = q->z;
}

/* alignment.py:76 */
fs_quaternion fs_level_attitude(const fs_vector3 *force, fs_real yaw_rad)
{
    const fs_real roll = fs_atan2(-force->y, -force->z);
    const fs_real pitch = fs_atan2(force->x, fs_sqrt(force->y * force->y + force->z * force->z));
    return fs_quaternion_from_euler(roll, pitch, yaw_rad);
}

/* Return the direction [rad] of the Earth's field. alignment.py:155 */
static fs_real north(const fs_vector3 *earth, fs_real declination_rad)
{
    if (earth->x != FS_LIT(0.0) || earth->y != FS_LIT(0.0)) {
        return fs_atan2(earth->y, earth->x);
    }
    return fs_is_finite(declination_rad) ? declination_rad : FS_LIT(0.0);
}

/*
 * Set the covariance of the field: along it by a share of it, across it by an error of its direction.
 * alignment.py:179
 */
static void set_field_variances(fs_real p[27][27], const fs_vector3 *earth, fs_real scale, fs_real turn_rad,
                                const fs_estimator_params *params)
{
    const fs_real size = scale * scale;
    const fs_real turn = turn_rad * turn_rad;
    fs_reset_variance(p, FS_EARTH_FIELD, 3, params->earth_field_gauss * params->earth_field_gauss);
    p[FS_EARTH_FIELD][FS_EARTH_FIELD] += size * earth->x * earth->x + turn * earth->y * earth->y;
    p[FS_EARTH_FIELD][FS_EARTH_FIELD + 1] = (size - turn) * earth->x * earth->y;
    p[FS_EARTH_FIELD + 1][FS_EARTH_FIELD + 1] += size * earth->y * earth->y + turn * earth->x * earth->x;
    p[FS_EARTH_FIELD + 2][FS_EARTH_FIELD + 2] += size * earth->z * earth->z;
    fs_reset_variance(p, FS_BODY_FIELD, 3, params->body_field_gauss * params->body_field_gauss);
}

/* alignment.py:163 */
void fs_set_field(fs_filter *f, const fs_vector3 *level, const fs_vector3 *earth, fs_real declination_rad,
                  const fs_estimator_params *params)
{
    const bool known = earth->x != FS_LIT(0.0) || earth->y != FS_LIT(0.0);
    const fs_real horizontal = fs_sqrt(level->x * level->x + level->y * level->y);
    fs_real sine;
    fs_real cosine;
    fs_sin_cos(north(earth, declination_rad), &sine, &cosine);
    fs_vector3 chosen;
    if (known) {
        chosen = *earth;
    } else {
        chosen = (fs_vector3){cosine * horizontal, sine * horizontal, level->z};
    }
    const fs_vector3 start = chosen;
    fs_write_vector(f->nominal, 16, &start);
    const fs_vector3 v = {FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};
    fs_write_vector(f->nominal, 19, &v);
    /* level is the measurement itself, which is fused next */
    const fs_real scale = known ? params->field_scale : FS_LIT(1.0);
    const fs_real turn_rad = known || fs_is_finite(declination_rad) ? FS_LIT(0.0) : params->declination_rad;
    set_field_variances(f->covariance, &start, scale, turn_rad, params);
}

/* alignment.py:141 */
fs_real fs_turn_to_field(fs_filter *f, const fs_vector3 *field, const fs_vector3 *earth, fs_real declination_rad,
                         const fs_estimator_params *params)
{
    const fs_nominal n = fs_read_nominal(f->nominal);
    const fs_vector3 level = fs_rotate(&n.attitude, field);
    const fs_real turn = fs_wrap_pi(north(earth, declination_rad) - fs_atan2(level.y, level.x));
    const fs_vector3 world_rotation = {FS_LIT(0.0), FS_LIT(0.0), turn};
    const fs_quaternion turned = fs_turned(&n.attitude, &world_rotation);
    set_attitude(f, &turned);
    fs_reset_variance(f->covariance, FS_ATTITUDE + 2, 1, FS_UNKNOWN_YAW_RAD * FS_UNKNOWN_YAW_RAD);
    fs_set_field(f, &level, earth, declination_rad, params);
    return turn;
}

/* alignment.py:131 */
fs_real fs_align_yaw(fs_filter *f, const fs_vector3 *field, const fs_vector3 *earth, fs_real declination_rad,
                     const fs_estimator_params *params)
{
    const fs_real turn_rad = fs_turn_to_field(f, field, earth, declination_rad, params);
    fs_fuse_field(f, field, params);
    return turn_rad;
}

/* alignment.py:100 */
void fs_align(fs_filter *f, const fs_alignment *sums, const fs_vector3 *earth, fs_real declination_rad,
              const fs_estimator_params *params)
{
    const fs_vector3 force = fs_read_vector(sums->force, 0);
    const fs_real off = fs_abs(fs_sqrt(force.x * force.x + force.y * force.y + force.z * force.z) / sums->forces -
                               params->gravity_m_s2);
    const bool moves = off > FS_LIT(1.0);
    for (int32_t i = 0; i < 28; i++) {
        f->nominal[i] = FS_LIT(0.0);
    }
    fs_set_initial_variances(f, params, moves ? FS_LIT(5.0) : FS_LIT(0.1), moves ? FS_LIT(0.3) : params->tilt_rad);
    const fs_quaternion level_attitude = fs_level_attitude(&force, FS_LIT(0.0));
    set_attitude(f, &level_attitude);
    const fs_real count = sums->fields;
    if (count > FS_LIT(0.0)) {
        const fs_vector3 total = fs_read_vector(sums->field, 0);
        const fs_vector3 field = {total.x / count, total.y / count, total.z / count};
        (void)fs_align_yaw(f, &field, earth, declination_rad, params);
    }
}
