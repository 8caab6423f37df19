/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Height: the barometer and its bias, the range finder above level ground, and resets to GNSS.
 * flightstack/estimation/height_sources.py
 */
#include "fs_height_sources.h"

#include "fs_fusion.h"
#include "fs_math.h"
#include "fs_resets.h"
#include "fs_source_checks.h"

#define FS_BARO 6
#define FS_GNSS_VELOCITY 0
#define FS_AIDED_S FS_LIT(1.0)
#define FS_POSITION 6
#define FS_BARO_BIAS 23
#define FS_LEAST_COS_TILT FS_LIT(0.7)
#define FS_RANGE 10
#define FS_RANGE_LOST_S FS_LIT(1.0)

/* Set the barometer's bias so that the first altitude agrees with the height. height_sources.py:44 */
static void start_baro(fs_estimator_memory *m, fs_filter *f, fs_real altitude_m, const fs_estimator_params *params)
{
    f->nominal[24] = altitude_m + f->nominal[9];
    const int32_t at = FS_POSITION + 2;
    for (int32_t j = 0; j < at; j++) {
        f->covariance[j][FS_BARO_BIAS] = f->covariance[j][at];
    }
    for (int32_t j = at; j < 23; j++) {
        f->covariance[j][FS_BARO_BIAS] = f->covariance[at][j];
    }
    for (int32_t j = FS_BARO_BIAS + 1; j < 27; j++) {
        f->covariance[FS_BARO_BIAS][j] = f->covariance[at][j];
    }
    f->covariance[FS_BARO_BIAS][FS_BARO_BIAS] = f->covariance[FS_POSITION + 2][FS_POSITION + 2] +
                                                params->baro_noise_m * params->baro_noise_m;
    m->flags.has_baro = 1;
}

/* height_sources.py:21 */
void fs_take_baro(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params)
{
    fs_checks *c = &m->checks;
    bool has_stopped = false;
    if (m->flags.landed == 0) {
        has_stopped = fs_is_stuck(c, row[1], row[0]);
    }
    if (has_stopped) {
        m->flags.has_baro = 0;
        return;
    }
    const fs_real last_s = f->observations[FS_BARO].fused_s;
    const fs_real speed_s = f->observations[FS_GNSS_VELOCITY + 2].fused_s;
    if (f->clock[0] - last_s > params->reset_s && f->clock[0] - speed_s < FS_AIDED_S) {
        m->flags.has_baro = 0;
    }
    if (m->flags.has_baro == 0) {
        start_baro(m, f, row[1], params);
    }
    fs_fuse_baro(f, row[1], f->clock[0] - row[0], params);
    fs_take_pressure_innovation(c, f, row[0], row[1]);
}

/* height_sources.py:60 */
void fs_take_range(fs_estimator_memory *m, fs_filter *f, const fs_real row[], const fs_estimator_params *params)
{
    const fs_real cos_tilt = fs_cos_tilt_of(f);
    if (cos_tilt < FS_LEAST_COS_TILT) {
        return;
    }
    if (m->flags.has_range == 1 && f->clock[0] - f->observations[FS_RANGE].fused_s > FS_RANGE_LOST_S) {
        m->flags.has_range = 0;
    }
    const fs_real age_s = f->clock[0] - row[0];
    if (m->flags.has_range == 0) {
        m->ground_m = f->nominal[9] - age_s * f->nominal[6] + row[1] * cos_tilt;
        m->flags.has_range = 1;
    }
    fs_fuse_range(f, row[1] * cos_tilt, m->ground_m, age_s, params);
}

/* height_sources.py:75 */
void fs_reset_height(fs_estimator_memory *m, fs_filter *f, const fs_real row[])
{
    fs_reset_position(m, f, row, 2, 1);
    m->flags.has_baro = 0;
    m->flags.has_range = 0;
}
