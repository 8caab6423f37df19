/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Yaw from GNSS velocity: a bank of models that start at yaws all around, weighed by how well each predicts velocity.
 * flightstack/estimation/yaw_estimator.py
 */
#include "fs_yaw_estimator.h"

#include "fs_error_state.h"
#include "fs_estimation_geometry.h"
#include "fs_estimation_math.h"
#include "fs_geometry.h"
#include "fs_law_math.h"
#include "fs_math.h"

#define FS_V 4
#define FS_P 6
#define FS_STATES 5
#define FS_GYRO_NOISE FS_LIT(0.01)
#define FS_ACCEL_NOISE FS_LIT(0.5)
#define FS_SPACING_RAD FS_LIT(1.2566370614359172)
#define FS_TILT_RAD FS_LIT(0.05)
#define FS_YAW_RAD FS_LIT(0.6283185307179586)
#define FS_MODELS 5
#define FS_WEIGHT 31
#define FS_LARGEST_SQUARE FS_LIT(25.0)
#define FS_LEAST_WEIGHT FS_LIT(1e-05)

/* yaw_estimator.py:34 */
fs_quaternion fs_attitude_of(const fs_real models[5][32], int32_t number)
{
    return (fs_quaternion){
        .w = models[number][0],
        .x = models[number][1],
        .y = models[number][2],
        .z = models[number][3],
    };
}

/* yaw_estimator.py:47 */
static void write_attitude(fs_real models[5][32], int32_t number, const fs_quaternion *q)
{
    models[number][0] = q->w;
    models[number][1] = q->x;
    models[number][2] = q->y;
    models[number][3] = q->z;
}

/* yaw_estimator.py:68 */
void fs_predict_models(fs_real models[5][32], const fs_vector3 *angle, const fs_vector3 *delta_velocity, fs_real dt_s)
{
    const fs_quaternion half = fs_rotation_over(angle, FS_LIT(0.5));
    const fs_quaternion whole = fs_rotation_over(angle, FS_LIT(1.0));
    for (int32_t k = 0; k < 5; k++) {
        const fs_quaternion q = fs_attitude_of((const fs_real(*)[32])models, k);
        const fs_quaternion quaternion_product = fs_quaternion_product(&q, &half);
        const fs_vector3 a = fs_rotate(&quaternion_product, delta_velocity);
        const fs_quaternion quaternion_product_2 = fs_quaternion_product(&q, &whole);
        const fs_quaternion normalised = fs_normalised(&quaternion_product_2);
        write_attitude(models, k, &normalised);
        models[k][FS_V] += a.x;
        models[k][FS_V + 1] += a.y;
        for (int32_t j = 0; j < 5; j++) {
            const fs_real tilt_n = models[k][FS_P + j];
            const fs_real tilt_e = models[k][FS_P + 5 + j];
            const fs_real yaw = models[k][FS_P + 10 + j];
            models[k][FS_P + 15 + j] += a.z * tilt_e - a.y * yaw;
            models[k][FS_P + 20 + j] += a.x * yaw - a.z * tilt_n;
        }
        for (int32_t i = 0; i < 5; i++) {
            const int32_t at = FS_P + FS_STATES * i;
            models[k][at + 3] += a.z * models[k][at + 1] - a.y * models[k][at + 2];
            models[k][at + 4] += a.x * models[k][at + 2] - a.z * models[k][at];
        }
        for (int32_t i = 0; i < 5; i++) {
            const fs_real noise = i < 3 ? FS_GYRO_NOISE : FS_ACCEL_NOISE;
            models[k][FS_P + 6 * i] += noise * noise * dt_s;
        }
    }
}

/* yaw_estimator.py:52 */
void fs_start_models(fs_real models[5][32], const fs_quaternion *attitude, fs_real north_m_s, fs_real east_m_s,
                     fs_real variance)
{
    for (int32_t k = 0; k < 5; k++) {
        for (int32_t i = 0; i < 32; i++) {
            models[k][i] = FS_LIT(0.0);
        }
        const fs_vector3 world_rotation = {FS_LIT(0.0), FS_LIT(0.0), FS_SPACING_RAD * (fs_real)k};
        const fs_quaternion turned = fs_turned(attitude, &world_rotation);
        write_attitude(models, k, &turned);
        models[k][FS_V] = north_m_s;
        models[k][FS_V + 1] = east_m_s;
        models[k][FS_P] = FS_TILT_RAD * FS_TILT_RAD;
        models[k][FS_P + 6] = FS_TILT_RAD * FS_TILT_RAD;
        models[k][FS_P + 12] = FS_YAW_RAD * FS_YAW_RAD;
        models[k][FS_P + 18] = variance;
        models[k][FS_P + 24] = variance;
        models[k][FS_WEIGHT] = FS_LIT(1.0) / (fs_real)FS_MODELS;
    }
}

/*
 * Fuse a velocity; return the squared innovation by its variance plus the logarithm's share of that variance.
 * yaw_estimator.py:91
 */
static fs_real update_model(fs_real models[5][32], int32_t k, fs_real north_m_s, fs_real east_m_s, fs_real variance)
{
    fs_real *p = models[k];
    const fs_real s00 = p[FS_P + 18] + variance;
    const fs_real s01 = p[FS_P + 19];
    const fs_real s11 = p[FS_P + 24] + variance;
    const fs_real scale = FS_LIT(1.0) / (s00 * s11 - s01 * s01);
    const fs_real i00 = s11 * scale;
    const fs_real i01 = -s01 * scale;
    const fs_real i11 = s00 * scale;
    fs_real north = north_m_s - p[FS_V];
    fs_real east = east_m_s - p[FS_V + 1];
    const fs_real square = north * (i00 * north + i01 * east) + east * (i01 * north + i11 * east);
    const fs_real share = square > FS_LARGEST_SQUARE ? fs_sqrt(FS_LARGEST_SQUARE / square) : FS_LIT(1.0);
    fs_real gain[5][2] = {0};
    fs_real column[5][2] = {0};
    for (int32_t i = 0; i < 5; i++) {
        const fs_real value = p[FS_P + 5 * i + 3];
        const fs_real value_2 = p[FS_P + 5 * i + 4];
        column[i][0] = value;
        column[i][1] = value_2;
        gain[i][0] = column[i][0] * i00 + column[i][1] * i01;
        gain[i][1] = column[i][0] * i01 + column[i][1] * i11;
    }
    for (int32_t i = 0; i < 5; i++) {
        for (int32_t j = 0; j < 5; j++) {
            p[FS_P + 5 * i + j] -= gain[i][0] * column[j][0] + gain[i][1] * column[j][1];
        }
    }
    north *= share;
    east *= share;
    const fs_vector3 turn = {
        .x = gain[0][0] * north + gain[0][1] * east,
        .y = gain[1][0] * north + gain[1][1] * east,
        .z = gain[2][0] * north + gain[2][1] * east,
    };
    const fs_quaternion attitude_of = fs_attitude_of((const fs_real(*)[32])models, k);
    const fs_quaternion turned = fs_turned(&attitude_of, &turn);
    write_attitude(models, k, &turned);
    p[FS_V] += gain[3][0] * north + gain[3][1] * east;
    p[FS_V + 1] += gain[4][0] * north + gain[4][1] * east;
    const fs_real cost = fs_min(square, FS_LIT(2.0) * FS_LARGEST_SQUARE) - fs_log(scale);
    return cost;
}

/* yaw_estimator.py:123 */
void fs_update_models(fs_real models[5][32], fs_real north_m_s, fs_real east_m_s, fs_real variance)
{
    fs_real costs[5] = {0};
    fs_real least = FS_INFINITY;
    fs_real total = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        costs[k] = update_model(models, k, north_m_s, east_m_s, variance);
        least = fs_min(least, costs[k]);
    }
    for (int32_t k = 0; k < 5; k++) {
        const fs_real weight = fs_max(models[k][FS_WEIGHT] * fs_exp(FS_LIT(0.5) * (least - costs[k])),
                                      FS_LEAST_WEIGHT);
        models[k][FS_WEIGHT] = weight;
        total += weight;
    }
    for (int32_t k = 0; k < 5; k++) {
        models[k][FS_WEIGHT] /= total;
    }
}

/* yaw_estimator.py:138 */
fs_real fs_mean_turn(const fs_real models[5][32], const fs_quaternion *attitude)
{
    fs_real x = FS_LIT(0.0);
    fs_real y = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        const fs_quaternion attitude_of = fs_attitude_of((const fs_real(*)[32])models, k);
        fs_real sine;
        fs_real cosine;
        fs_sin_cos(fs_turn_between(attitude, &attitude_of), &sine, &cosine);
        x += models[k][FS_WEIGHT] * cosine;
        y += models[k][FS_WEIGHT] * sine;
    }
    return fs_atan2(y, x);
}

/* yaw_estimator.py:149 */
fs_real fs_variance_of(const fs_real models[5][32], const fs_quaternion *attitude, fs_real turn_rad)
{
    fs_real total = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        const fs_quaternion attitude_of = fs_attitude_of((const fs_real(*)[32])models, k);
        const fs_real off = fs_wrap_pi(fs_turn_between(attitude, &attitude_of) - turn_rad);
        total += models[k][FS_WEIGHT] * (models[k][FS_P + 12] + off * off);
    }
    return total;
}

/* yaw_estimator.py:159 */
int32_t fs_likeliest(const fs_real models[5][32])
{
    int32_t best = 0;
    for (int32_t k = 0; k < 5; k++) {
        if (models[k][FS_WEIGHT] > models[best][FS_WEIGHT]) {
            best = k;
        }
    }
    return best;
}

/* yaw_estimator.py:40 */
fs_real fs_tilt_variance(const fs_real models[5][32], int32_t number, int32_t axis)
{
    const fs_real variance = models[number][FS_P + 6 * axis];
    return variance;
}
