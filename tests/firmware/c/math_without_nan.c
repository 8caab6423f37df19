/*
 * fs_math.c for a processor without NaN, on which sine and cosine of an angle that has none may be any numbers: a
 * test must show that the loops never ask for them.
 */
#define fs_sin_cos ieee_sin_cos
#include "fs_math.c"
#undef fs_sin_cos

fs_sine_cosine fs_sin_cos(fs_real angle_rad);

fs_sine_cosine fs_sin_cos(fs_real angle_rad)
{
    fs_sine_cosine result = ieee_sin_cos(angle_rad);

    if (!fs_is_finite(result.sine)) {
        result.sine = FS_LIT(0.6);
        result.cosine = FS_LIT(0.8);
    }
    return result;
}
