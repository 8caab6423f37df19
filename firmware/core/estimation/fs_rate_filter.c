/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).
 * flightstack/estimation/rate_filter.py
 */
#include "fs_rate_filter.h"

#include "fs_math.h"
#include "fs_portable_math.h"

#define FS_HIGHEST_SHARE FS_LIT(0.45)
#define FS_DAMPING FS_LIT(1.4142135623730951)

/* rate_filter.py:38 */
static void start(fs_rate_filter *x, const fs_vector3 *gyro)
{
    x->band[0] = FS_LIT(0.0);
    x->band[1] = FS_LIT(0.0);
    x->band[2] = FS_LIT(0.0);
    x->low[0] = gyro->x;
    x->low[1] = gyro->y;
    x->low[2] = gyro->z;
}

/* Return the filtered value of one axis. rate_filter.py:44 */
static fs_real filter_axis(fs_rate_filter *x, int32_t axis, fs_real value)
{
    const fs_real g = x->factor;
    const fs_real a1 = FS_LIT(1.0) / (FS_LIT(1.0) + g * (g + FS_DAMPING));
    const fs_real step = value - x->low[axis];
    const fs_real band = a1 * (x->band[axis] + g * step);
    const fs_real low = x->low[axis] + g * band;
    x->band[axis] = FS_LIT(2.0) * band - x->band[axis];
    x->low[axis] = FS_LIT(2.0) * low - x->low[axis];
    return low;
}

/* rate_filter.py:56 */
fs_vector3 fs_filtered_rates(fs_rate_filter *x, const fs_vector3 *gyro, fs_real dt_s, fs_real cutoff_hz)
{
    if (cutoff_hz <= FS_LIT(0.0) || cutoff_hz * dt_s >= FS_HIGHEST_SHARE) {
        start(x, gyro);
        x->step_s = FS_LIT(0.0);
        return *gyro;
    }
    if (x->step_s != dt_s || x->cutoff_hz != cutoff_hz) {
        if (x->step_s == FS_LIT(0.0)) {
            start(x, gyro);
        }
        x->step_s = dt_s;
        x->cutoff_hz = cutoff_hz;
        x->factor = fs_tan(FS_PI * cutoff_hz * dt_s);
    }
    const fs_real roll = filter_axis(x, 0, gyro->x);
    const fs_real pitch = filter_axis(x, 1, gyro->y);
    const fs_real yaw = filter_axis(x, 2, gyro->z);
    return (fs_vector3){roll, pitch, yaw};
}
