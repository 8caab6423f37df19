/*
 * fs_math.c for a processor without NaN, on which sine and cosine of an angle that has none may be any numbers: a
 * test must show that the loops never ask for them.
 */
#define fs_sin_cos ieee_sin_cos
#include "fs_math.c"
#undef fs_sin_cos

void fs_sin_cos(fs_real angle_rad, fs_real *sine_out, fs_real *cosine_out);

void fs_sin_cos(fs_real angle_rad, fs_real *sine_out, fs_real *cosine_out)
{
    ieee_sin_cos(angle_rad, sine_out, cosine_out);
    if (!fs_is_finite(*sine_out)) {
        *sine_out = FS_LIT(0.6);
        *cosine_out = FS_LIT(0.8);
    }
}
