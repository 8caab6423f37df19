#include "fs_geometry.h"

#include "fs_math.h"

fs_vector3 fs_rotation_vector(const fs_quaternion *q)
{
    const fs_real sign = q->w >= FS_LIT(0.0) ? FS_LIT(1.0) : FS_LIT(-1.0);
    const fs_real norm = fs_sqrt(q->x * q->x + q->y * q->y + q->z * q->z);
    fs_real scale = FS_LIT(2.0) * sign;
    fs_vector3 vector;

    if (!(norm < FS_LIT(1e-9))) { /* else the series' first term: the quotient would lose digits */
        scale = FS_LIT(2.0) * fs_atan2(norm, sign * q->w) / norm * sign;
    }
    vector.x = q->x * scale;
    vector.y = q->y * scale;
    vector.z = q->z * scale;
    return vector;
}

fs_quaternion fs_rotation_over(const fs_vector3 *rates_rad_s, fs_real dt_s)
{
    const fs_real norm = fs_sqrt(rates_rad_s->x * rates_rad_s->x + rates_rad_s->y * rates_rad_s->y +
                                 rates_rad_s->z * rates_rad_s->z);
    const fs_real half = FS_LIT(0.5) * norm * dt_s;
    const fs_sine_cosine of_half = fs_sin_cos(half);
    const fs_real scale = half < FS_LIT(1e-9) ? FS_LIT(0.5) * dt_s : of_half.sine / norm;
    fs_quaternion rotation;

    rotation.w = of_half.cosine;
    rotation.x = rates_rad_s->x * scale;
    rotation.y = rates_rad_s->y * scale;
    rotation.z = rates_rad_s->z * scale;
    return rotation;
}

fs_quaternion fs_quaternion_from_euler(fs_real roll_rad, fs_real pitch_rad, fs_real yaw_rad)
{
    const fs_sine_cosine roll = fs_sin_cos(FS_LIT(0.5) * roll_rad);
    const fs_sine_cosine pitch = fs_sin_cos(FS_LIT(0.5) * pitch_rad);
    const fs_sine_cosine yaw = fs_sin_cos(FS_LIT(0.5) * yaw_rad);
    fs_quaternion q;

    q.w = roll.cosine * pitch.cosine * yaw.cosine + roll.sine * pitch.sine * yaw.sine;
    q.x = roll.sine * pitch.cosine * yaw.cosine - roll.cosine * pitch.sine * yaw.sine;
    q.y = roll.cosine * pitch.sine * yaw.cosine + roll.sine * pitch.cosine * yaw.sine;
    q.z = roll.cosine * pitch.cosine * yaw.sine - roll.sine * pitch.sine * yaw.cosine;
    return q;
}
