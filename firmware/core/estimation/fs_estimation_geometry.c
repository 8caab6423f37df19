/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Quaternions, Euler angles and vectors for compiled code. flightstack/core/geometry.py */
#include "fs_estimation_geometry.h"

#include "fs_law_math.h"
#include "fs_math.h"

/* geometry.py:123 */
fs_quaternion fs_quaternion_from_euler(fs_real roll_rad, fs_real pitch_rad, fs_real yaw_rad)
{
    fs_real sr;
    fs_real cr;
    fs_sin_cos(FS_LIT(0.5) * roll_rad, &sr, &cr);
    fs_real sp;
    fs_real cp;
    fs_sin_cos(FS_LIT(0.5) * pitch_rad, &sp, &cp);
    fs_real sy;
    fs_real cy;
    fs_sin_cos(FS_LIT(0.5) * yaw_rad, &sy, &cy);
    return (fs_quaternion){
        .w = cr * cp * cy + sr * sp * sy,
        .x = sr * cp * cy - cr * sp * sy,
        .y = cr * sp * cy + sr * cp * sy,
        .z = cr * cp * sy - sr * sp * cy,
    };
}

/* geometry.py:147 */
fs_real fs_wrap_pi(fs_real angle_rad)
{
    return angle_rad - FS_LIT(2.0) * FS_PI * fs_floor((angle_rad + FS_PI) / (FS_LIT(2.0) * FS_PI));
}
