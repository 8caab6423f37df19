/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).
 * flightstack/estimation/rate_filter.py
 */
#include "fs_rate_filter.h"

#include "fs_math.h"
#include "fs_portable_math.h"

#define FS_HIGHEST_SHARE FS_LIT(0.45)
#define FS_STEP_S 6
#define FS_CUTOFF_HZ 7
#define FS_FACTOR 8
#define FS_DAMPING FS_LIT(1.4142135623730951)

/* rate_filter.py:28 */
static void start(fs_real x[9], const fs_vector3 *gyro)
{
    x[0] = FS_LIT(0.0);
    x[1] = gyro->x;
    x[2] = FS_LIT(0.0);
    x[3] = gyro->y;
    x[4] = FS_LIT(0.0);
    x[5] = gyro->z;
}

/* Return the filtered value of one axis. rate_filter.py:33 */
static fs_real filter_axis(fs_real x[9], int32_t at, fs_real value)
{
    const fs_real g = x[FS_FACTOR];
    const fs_real a1 = FS_LIT(1.0) / (FS_LIT(1.0) + g * (g + FS_DAMPING));
    const fs_real step = value - x[at + 1];
    const fs_real band = a1 * (x[at] + g * step);
    const fs_real low = x[at + 1] + g * band;
    x[at] = FS_LIT(2.0) * band - x[at];
    x[at + 1] = FS_LIT(2.0) * low - x[at + 1];
    return low;
}

/* rate_filter.py:45 */
fs_vector3 fs_filtered_rates(fs_real x[9], const fs_vector3 *gyro, fs_real dt_s, fs_real cutoff_hz)
{
    if (cutoff_hz <= FS_LIT(0.0) || cutoff_hz * dt_s >= FS_HIGHEST_SHARE) {
        start(x, gyro);
        x[FS_STEP_S] = FS_LIT(0.0);
        return *gyro;
    }
    if (x[FS_STEP_S] != dt_s || x[FS_CUTOFF_HZ] != cutoff_hz) {
        if (x[FS_STEP_S] == FS_LIT(0.0)) {
            start(x, gyro);
        }
        x[FS_STEP_S] = dt_s;
        x[FS_CUTOFF_HZ] = cutoff_hz;
        x[FS_FACTOR] = fs_tan(FS_PI * cutoff_hz * dt_s);
    }
    const fs_real roll = filter_axis(x, 0, gyro->x);
    const fs_real pitch = filter_axis(x, 2, gyro->y);
    const fs_real yaw = filter_axis(x, 4, gyro->z);
    return (fs_vector3){roll, pitch, yaw};
}
