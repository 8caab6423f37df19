#include "fs_geometry.h"

#include "fs_math.h"

#define LARGEST_SQUARE FS_LIT(0.1715) /* of the tangent of half an angle up to 45 degrees */
#define LEAST_LENGTH FS_LIT(1e-30)    /* stands for zero where one divides by a length */

/* Arc tangent of a ratio, divided by it, less one; of the ratio's square up to LARGEST_SQUARE. Chebyshev's nodes. */
static fs_real arc_tangent_series(fs_real square)
{
    fs_real sum;
#ifdef FS_DOUBLE
    sum = -0.01917454357202133; /* off by 5e-18 at most */
    sum = sum * square + 0.039229744536612224;
    sum = sum * square - 0.05085383488842831;
    sum = sum * square + 0.05858136251906146;
    sum = sum * square - 0.06664509989818045;
    sum = sum * square + 0.07692183087342026;
    sum = sum * square - 0.0909090457366906;
    sum = sum * square + 0.11111111015146714;
    sum = sum * square - 0.1428571428466518;
    sum = sum * square + 0.19999999999995513;
    sum = sum * square - 0.3333333333333333;
#else
    sum = -0.06451597258952992F; /* off by 3e-9 at most */
    sum = sum * square + 0.10743631627144574F;
    sum = sum * square - 0.1426394635791234F;
    sum = sum * square + 0.19999540216937534F;
    sum = sum * square - 0.3333333176000804F;
#endif
    return sum * square;
}

fs_vector3 fs_rotation_vector(const fs_quaternion *q)
{
    const fs_real square = q->x * q->x + q->y * q->y + q->z * q->z, w_square = q->w * q->w;
    fs_real inverse, ratio_square, scale;
    fs_vector3 vector;

    if (square < LARGEST_SQUARE * w_square) { /* below 45 degrees: 2 atan(norm / w) / norm, without the norm */
        inverse = FS_LIT(1.0) / q->w;
        ratio_square = square * inverse * inverse;
        scale = FS_LIT(2.0) * inverse;
    } else { /* the tangent of an eighth of the angle: tan(a/2) = sin a / (cos a + 1), twice */
        const fs_real half = fs_abs(q->w) + fs_sqrt(w_square + square);
        const fs_real quarter = half + fs_sqrt(half * half + square);
        inverse = FS_LIT(1.0) / fs_max(quarter, LEAST_LENGTH);
        ratio_square = square * inverse * inverse;
        scale = q->w >= FS_LIT(0.0) ? FS_LIT(8.0) * inverse : FS_LIT(-8.0) * inverse;
    }
    scale = scale + scale * arc_tangent_series(ratio_square);
    vector.x = q->x * scale;
    vector.y = q->y * scale;
    vector.z = q->z * scale;
    return vector;
}

#define SMALL_SQUARE FS_LIT(0.01) /* of half the angle of a short step: 11 degrees */

fs_quaternion fs_rotation_over(const fs_vector3 *rates_rad_s, fs_real dt_s)
{
    const fs_real rate_square =
        rates_rad_s->x * rates_rad_s->x + rates_rad_s->y * rates_rad_s->y + rates_rad_s->z * rates_rad_s->z;
    const fs_real half_dt = FS_LIT(0.5) * dt_s, square = rate_square * (half_dt * half_dt);
    fs_quaternion rotation;
    fs_real scale;

    if (square <= SMALL_SQUARE) { /* Taylor's series of cosine and of sine by angle: no norm needed */
        fs_real cosine, sine;
#ifdef FS_DOUBLE
        cosine = (square * (1.0 / 40320.0) - 1.0 / 720.0) * square + 1.0 / 24.0;
        sine = ((square * (1.0 / 362880.0) - 1.0 / 5040.0) * square + 1.0 / 120.0) * square - 1.0 / 6.0;
#else
        cosine = 1.0F / 24.0F;
        sine = square * (1.0F / 120.0F) - 1.0F / 6.0F;
#endif
        rotation.w = FS_LIT(1.0) - (FS_LIT(0.5) * square - square * (square * cosine));
        scale = half_dt + half_dt * (square * sine);
    } else {
        const fs_real norm = fs_sqrt(rate_square);
        const fs_sine_cosine of_half = fs_sin_cos(norm * half_dt);
        rotation.w = of_half.cosine;
        scale = of_half.sine / norm;
    }
    rotation.x = rates_rad_s->x * scale;
    rotation.y = rates_rad_s->y * scale;
    rotation.z = rates_rad_s->z * scale;
    return rotation;
}
