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

#define FS_GYRO_NOISE FS_LIT(0.01)
#define FS_ACCEL_NOISE FS_LIT(0.5)
#define FS_SPACING_RAD FS_LIT(1.2566370614359172)
#define FS_TILT_RAD FS_LIT(0.05)
#define FS_YAW_RAD FS_LIT(0.6283185307179586)
#define FS_MODELS 5
#define FS_LARGEST_SQUARE FS_LIT(25.0)
#define FS_LEAST_WEIGHT FS_LIT(1e-05)

/* yaw_estimator.py:54 */
fs_quaternion fs_attitude_of(const fs_yaw_model *model)
{
    return (fs_quaternion){
        .w = model->attitude[0],
        .x = model->attitude[1],
        .y = model->attitude[2],
        .z = model->attitude[3],
    };
}

/* yaw_estimator.py:68 */
static void write_attitude(fs_yaw_model *model, const fs_quaternion *attitude)
{
    model->attitude[0] = attitude->w;
    model->attitude[1] = attitude->x;
    model->attitude[2] = attitude->y;
    model->attitude[3] = attitude->z;
}

/* yaw_estimator.py:92 */
void fs_predict_models(fs_yaw_bank *bank, const fs_vector3 *angle, const fs_vector3 *delta_velocity, fs_real dt_s)
{
    const fs_quaternion half = fs_rotation_over(angle, FS_LIT(0.5));
    const fs_quaternion whole = fs_rotation_over(angle, FS_LIT(1.0));
    for (int32_t k = 0; k < 5; k++) {
        fs_yaw_model *model = &bank->models[k];
        const fs_quaternion q = fs_attitude_of(model);
        const fs_quaternion quaternion_product = fs_quaternion_product(&q, &half);
        const fs_vector3 a = fs_rotate(&quaternion_product, delta_velocity);
        const fs_quaternion quaternion_product_2 = fs_quaternion_product(&q, &whole);
        const fs_quaternion normalised = fs_normalised(&quaternion_product_2);
        write_attitude(model, &normalised);
        model->north_m_s += a.x;
        model->east_m_s += a.y;
        for (int32_t j = 0; j < 5; j++) {
            const fs_real tilt_n = model->covariance[0][j];
            const fs_real tilt_e = model->covariance[1][j];
            const fs_real yaw = model->covariance[2][j];
            model->covariance[3][j] += a.z * tilt_e - a.y * yaw;
            model->covariance[4][j] += a.x * yaw - a.z * tilt_n;
        }
        for (int32_t i = 0; i < 5; i++) {
            model->covariance[i][3] += a.z * model->covariance[i][1] - a.y * model->covariance[i][2];
            model->covariance[i][4] += a.x * model->covariance[i][2] - a.z * model->covariance[i][0];
        }
        for (int32_t i = 0; i < 5; i++) {
            const fs_real noise = i < 3 ? FS_GYRO_NOISE : FS_ACCEL_NOISE;
            model->covariance[i][i] += noise * noise * dt_s;
        }
    }
}

/* yaw_estimator.py:74 */
void fs_start_models(fs_yaw_bank *bank, const fs_quaternion *attitude, fs_real north_m_s, fs_real east_m_s,
                     fs_real variance)
{
    for (int32_t k = 0; k < 5; k++) {
        fs_yaw_model *model = &bank->models[k];
        const fs_vector3 world_rotation = {FS_LIT(0.0), FS_LIT(0.0), FS_SPACING_RAD * (fs_real)k};
        const fs_quaternion turned = fs_turned(attitude, &world_rotation);
        write_attitude(model, &turned);
        model->north_m_s = north_m_s;
        model->east_m_s = east_m_s;
        for (int32_t i = 0; i < 5; i++) {
            for (int32_t j = 0; j < 5; j++) {
                model->covariance[i][j] = FS_LIT(0.0);
            }
        }
        model->covariance[0][0] = FS_TILT_RAD * FS_TILT_RAD;
        model->covariance[1][1] = FS_TILT_RAD * FS_TILT_RAD;
        model->covariance[2][2] = FS_YAW_RAD * FS_YAW_RAD;
        model->covariance[3][3] = variance;
        model->covariance[4][4] = variance;
        model->weight = FS_LIT(1.0) / (fs_real)FS_MODELS;
    }
}

/*
 * Fuse a velocity; return the squared innovation by its variance plus the logarithm's share of that variance.
 * yaw_estimator.py:116
 */
static fs_real update_model(fs_yaw_model *model, fs_real north_m_s, fs_real east_m_s, fs_real variance)
{
    const fs_real s00 = model->covariance[3][3] + variance;
    const fs_real s01 = model->covariance[3][4];
    const fs_real s11 = model->covariance[4][4] + variance;
    const fs_real scale = FS_LIT(1.0) / (s00 * s11 - s01 * s01);
    const fs_real i00 = s11 * scale;
    const fs_real i01 = -s01 * scale;
    const fs_real i11 = s00 * scale;
    fs_real north = north_m_s - model->north_m_s;
    fs_real east = east_m_s - model->east_m_s;
    const fs_real square = north * (i00 * north + i01 * east) + east * (i01 * north + i11 * east);
    const fs_real share = square > FS_LARGEST_SQUARE ? fs_sqrt(FS_LARGEST_SQUARE / square) : FS_LIT(1.0);
    fs_real gain[5][2] = {0};
    fs_real column[5][2] = {0};
    for (int32_t i = 0; i < 5; i++) {
        const fs_real value = model->covariance[i][3];
        const fs_real value_2 = model->covariance[i][4];
        column[i][0] = value;
        column[i][1] = value_2;
        gain[i][0] = column[i][0] * i00 + column[i][1] * i01;
        gain[i][1] = column[i][0] * i01 + column[i][1] * i11;
    }
    for (int32_t i = 0; i < 5; i++) {
        for (int32_t j = 0; j < 5; j++) {
            model->covariance[i][j] -= gain[i][0] * column[j][0] + gain[i][1] * column[j][1];
        }
    }
    north *= share;
    east *= share;
    const fs_vector3 turn = {
        .x = gain[0][0] * north + gain[0][1] * east,
        .y = gain[1][0] * north + gain[1][1] * east,
        .z = gain[2][0] * north + gain[2][1] * east,
    };
    const fs_quaternion attitude_of = fs_attitude_of(model);
    const fs_quaternion turned = fs_turned(&attitude_of, &turn);
    write_attitude(model, &turned);
    model->north_m_s += gain[3][0] * north + gain[3][1] * east;
    model->east_m_s += gain[4][0] * north + gain[4][1] * east;
    const fs_real cost = fs_min(square, FS_LIT(2.0) * FS_LARGEST_SQUARE) - fs_log(scale);
    return cost;
}

/* yaw_estimator.py:148 */
void fs_update_models(fs_yaw_bank *bank, fs_real north_m_s, fs_real east_m_s, fs_real variance)
{
    fs_real costs[5] = {0};
    fs_real least = FS_INFINITY;
    fs_real total = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        costs[k] = update_model(&bank->models[k], north_m_s, east_m_s, variance);
        least = fs_min(least, costs[k]);
    }
    for (int32_t k = 0; k < 5; k++) {
        const fs_real weight = fs_max(bank->models[k].weight * fs_exp(FS_LIT(0.5) * (least - costs[k])),
                                      FS_LEAST_WEIGHT);
        bank->models[k].weight = weight;
        total += weight;
    }
    for (int32_t k = 0; k < 5; k++) {
        bank->models[k].weight /= total;
    }
}

/* yaw_estimator.py:164 */
fs_real fs_mean_turn(const fs_yaw_bank *bank, const fs_quaternion *attitude)
{
    fs_real x = FS_LIT(0.0);
    fs_real y = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        const fs_yaw_model *model = &bank->models[k];
        const fs_quaternion attitude_of = fs_attitude_of(model);
        fs_real sine;
        fs_real cosine;
        fs_sin_cos(fs_turn_between(attitude, &attitude_of), &sine, &cosine);
        x += model->weight * cosine;
        y += model->weight * sine;
    }
    return fs_atan2(y, x);
}

/* yaw_estimator.py:176 */
fs_real fs_variance_of(const fs_yaw_bank *bank, const fs_quaternion *attitude, fs_real turn_rad)
{
    fs_real total = FS_LIT(0.0);
    for (int32_t k = 0; k < 5; k++) {
        const fs_yaw_model *model = &bank->models[k];
        const fs_quaternion attitude_of = fs_attitude_of(model);
        const fs_real off = fs_wrap_pi(fs_turn_between(attitude, &attitude_of) - turn_rad);
        total += model->weight * (model->covariance[2][2] + off * off);
    }
    return total;
}

/* yaw_estimator.py:187 */
int32_t fs_likeliest(const fs_yaw_bank *bank)
{
    int32_t best = 0;
    for (int32_t k = 0; k < 5; k++) {
        if (bank->models[k].weight > bank->models[best].weight) {
            best = k;
        }
    }
    return best;
}

/* yaw_estimator.py:61 */
fs_real fs_tilt_variance(const fs_yaw_model *model, int32_t axis)
{
    const fs_real variance = model->covariance[axis][axis];
    return variance;
}
