#include "filter_steps.h"

#include "fs_estimation_math.h"
#include "fs_fusion.h"
#include "fs_imu_input.h"
#include "fs_output_predictor.h"
#include "fs_yaw_estimator.h"

#define FNV_START 2166136261UL
#define FNV_PRIME 16777619UL

void filter_steps_init(filter_steps *s, filter_clock clock)
{
    s->clock = clock;
    s->hash = FNV_START;
    s->least = 0xFFFFFFFFUL;
    s->memory.params = fs_default_estimator_params;
    fs_start_memory(&s->memory);
}

typedef union {
    uint32_t bits;
    fs_real number;
} filter_number;

/* A NaN counts as one value: its bits are the processor's. */
static uint32_t hashed(uint32_t hash, const fs_real *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        filter_number value;

        value.number = values[i];
        if (values[i] != values[i]) {
            value.bits = 0x7FC00000UL;
        }
        hash = (hash ^ value.bits) * FNV_PRIME;
    }
    return hash;
}

static void take(filter_steps *s)
{
    fs_estimator_memory *const m = &s->memory;
    uint32_t before, cost;
    uint16_t i;
    int32_t aligned;
    fs_real numbers[3];

    switch (s->kind) {
    case FILTER_IMU:
        aligned = m->flags.aligned;
        before = s->clock != 0 ? s->clock() : 0U;
        fs_imu_kernel(m, s->row);
        cost = s->clock != 0 ? s->clock() - before : 0U;
        s->samples++;
        s->sum += cost;
        s->most = (aligned == 1 && cost > s->most) ? cost : s->most; /* the alignment itself is done once, at rest */
        s->least = (aligned == 1 && cost < s->least) ? cost : s->least;
        break;
    case FILTER_FIELD:
        fs_field_kernel(m);
        break;
    case FILTER_LANDING:
        m->flags.landed = s->row[0] > FS_LIT(0.5) ? 1 : 0;
        break;
    case FILTER_EARTH:
        for (i = 0U; i < 4U; i++) {
            m->earth[i] = s->row[i];
        }
        break;
    case FILTER_PARAMS:
        for (i = 0U; i < s->size; i++) {
            ((fs_real *)&m->params)[i] = s->row[i];
        }
        break;
    case FILTER_HEALTH:
        fs_health_kernel(m, &s->summary.fields);
        s->hash = hashed(s->hash, s->summary.values, (uint16_t)(sizeof s->summary / sizeof s->summary.values[0]));
        break;
    case FILTER_NUMBERS:
        numbers[0] = fs_exp(s->row[0]);
        numbers[1] = fs_log(s->row[0]);
        numbers[2] = fs_atan2(s->row[0], s->row[1]);
        s->hash = hashed(s->hash, numbers, 3U);
        break;
#ifndef __AVR__ /* whose flash is full; its flights are short */
    case FILTER_ORIGIN:
        fs_move_clock_kernel(m, s->row[0]);
        break;
#endif
    default:
        fs_push_kernel(m, (int32_t)s->kind, s->row, (int32_t)s->size);
        break;
    }
    s->hash = hashed(s->hash, m->state, 13U);
}

uint16_t filter_steps_push(filter_steps *s, uint16_t octet)
{
    if (s->place == 0U) {
        s->kind = octet;
    } else if (s->place == 1U) {
        s->size = octet;
    } else {
        const uint16_t at = (uint16_t)(s->place - 2U);

        s->octets[at % 4U] = (unsigned char)octet;
        if (at % 4U == 3U) {
            filter_number value;

            value.bits = (uint32_t)s->octets[0] | ((uint32_t)s->octets[1] << 8) | ((uint32_t)s->octets[2] << 16)
                         | ((uint32_t)s->octets[3] << 24);
            s->row[at / 4U] = value.number;
        }
    }
    s->place++;
    if (s->place < 2U || s->place < (uint16_t)(2U + 4U * s->size)) {
        return 0U;
    }
    s->place = 0U;
    take(s);
    return 1U;
}

uint32_t filter_steps_hash(const filter_steps *s)
{
    const fs_filter *const f = &s->memory.filter;
    const fs_yaw_bank *const bank = &s->memory.yaw_bank;
    union {
        fs_observed fields;
        fs_real values[sizeof(fs_observed) / sizeof(fs_real)];
    } view;
    union {
        fs_yaw_model fields;
        fs_real values[sizeof(fs_yaw_model) / sizeof(fs_real)];
    } model;
    uint32_t hash = hashed(s->hash, f->nominal, (uint16_t)(sizeof f->nominal / sizeof f->nominal[0]));

    hash = hashed(hash, &f->covariance[0][0], (uint16_t)(sizeof f->covariance / sizeof f->covariance[0][0]));
    for (uint16_t i = 0U; i < (uint16_t)(sizeof f->observations / sizeof f->observations[0]); i++) {
        view.fields = f->observations[i];
        hash = hashed(hash, view.values, (uint16_t)(sizeof view.values / sizeof view.values[0]));
    }
    for (uint16_t i = 0U; i < (uint16_t)(sizeof bank->models / sizeof bank->models[0]); i++) {
        model.fields = bank->models[i];
        hash = hashed(hash, model.values, (uint16_t)(sizeof model.values / sizeof model.values[0]));
    }
    return hash;
}

#define COST(part, call)                \
    do {                                \
        const uint32_t at = s->clock(); \
        call;                           \
        costs[part] = s->clock() - at;  \
    } while (0)

void filter_steps_costs(filter_steps *s, uint32_t costs[FILTER_PARTS])
{
    fs_estimator_memory *const m = &s->memory;
    const fs_estimator_params *const p = &m->params;
    fs_filter *const f = &m->filter;
    static const fs_vector3 still = {FS_LIT(0.001), FS_LIT(0.002), FS_LIT(0.003)};
    static const fs_vector3 force = {FS_LIT(0.1), FS_LIT(0.2), FS_LIT(-0.4)};
    static fs_real gnss[10];
    const fs_imu_noise noise = fs_noise_of(&m->sums);
    static fs_delta_sample step;
    fs_motion motion;
    fs_nominal nominal;
    uint16_t i;

    for (i = 0U; i < FILTER_PARTS; i++) {
        costs[i] = 0U;
    }
    for (i = 0U; i < 3U; i++) {
        gnss[1U + i] = f->nominal[7U + i];
        gnss[4U + i] = f->nominal[4U + i];
        gnss[7U + i] = FS_LIT(0.5);
    }
    step.time_s = f->clock[0];
    step.dt_s = FS_LIT(0.01);
    step.angle_rad = still;
    step.velocity_m_s = force;
    COST(0, fs_predict(f, &step, p));
    COST(14, fs_predict_errors(f, &noise, p));
    COST(1, fs_predict_models(&m->yaw_bank, &still, &force, FS_LIT(0.01)));
    COST(2, fs_drift_gnss_bias(f, gnss, FS_LIT(0.2), p));
    COST(3, fs_fuse_gnss_velocity(f, gnss, 0, FS_LIT(0.0), p));
    COST(4, fs_fuse_gnss_position(f, gnss, FS_LIT(0.0), 0, FS_LIT(0.0), p));
    {
        const fs_vector3 field = {m->field[0], m->field[1], m->field[2]};

        COST(5, fs_fuse_field_axis(f, 0, &field, p));
    }
    COST(6, fs_fuse_baro(f, f->nominal[24] - f->nominal[9], FS_LIT(0.0), p));
    COST(7, fs_fuse_range(f, FS_LIT(1.0), f->nominal[9] + FS_LIT(1.0), FS_LIT(0.0), p));
    COST(8, fs_fuse_drag(f, 0, &force, p));
    COST(9, fs_fuse_rest_velocity(f, 0, p));
    COST(10, fs_fuse_rest_rate(f, 0, &still, FS_LIT(1e-6), p));
    COST(11, fs_fuse_hold(f, 0, f->nominal[7], p));
    COST(12, fs_update_models(&m->yaw_bank, FS_LIT(0.1), FS_LIT(0.2), FS_LIT(0.1)));
    nominal = fs_read_nominal(f->nominal);
    motion = fs_motion_of(&nominal);
    COST(13, fs_follow(&m->rings, m->output, &motion, FS_LIT(0.1), p->gravity_m_s2));
}
