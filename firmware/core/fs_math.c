#include "fs_math.h"

/*
 * pi/2 in three parts. The first two are so short that their product with the number of quarter turns, 13 bits for the
 * largest angle, is exact; so are the two differences, and the rest of the angle has almost no error.
 */
#ifdef FS_DOUBLE
#define HALF_PI_1 1.570796326734125614166259765625
#define HALF_PI_2 6.077100506303965976595549e-11
#define HALF_PI_3 2.0222662487959506e-21
#else
#define HALF_PI_1 1.5703125F
#define HALF_PI_2 4.837512969970703125e-4F
#define HALF_PI_3 7.549790126404332e-8F
#endif

/* Taylor's series up to pi/4: the first term left out is below a sixteenth of the rounding. square: of the angle. */
static fs_real sine_of_small(fs_real angle, fs_real square)
{
    fs_real sum;
#ifdef FS_DOUBLE
    sum = 1.0 / 355687428096000.0; /* 1/17! */
    sum = sum * square - 1.0 / 1307674368000.0;
    sum = sum * square + 1.0 / 6227020800.0;
    sum = sum * square - 1.0 / 39916800.0;
    sum = sum * square + 1.0 / 362880.0;
#else
    sum = 1.0F / 362880.0F; /* 1/9! */
#endif
    sum = sum * square - FS_LIT(1.0) / FS_LIT(5040.0);
    sum = sum * square + FS_LIT(1.0) / FS_LIT(120.0);
    sum = sum * square - FS_LIT(1.0) / FS_LIT(6.0);
    return angle + angle * (square * sum);
}

static fs_real cosine_of_small(fs_real square)
{
    fs_real sum;
#ifdef FS_DOUBLE
    sum = -1.0 / 6402373705728000.0; /* 1/18! */
    sum = sum * square + 1.0 / 20922789888000.0;
    sum = sum * square - 1.0 / 87178291200.0;
    sum = sum * square + 1.0 / 479001600.0;
    sum = sum * square - 1.0 / 3628800.0;
#else
    sum = -1.0F / 3628800.0F; /* 1/10! */
#endif
    sum = sum * square + FS_LIT(1.0) / FS_LIT(40320.0);
    sum = sum * square - FS_LIT(1.0) / FS_LIT(720.0);
    sum = sum * square + FS_LIT(1.0) / FS_LIT(24.0);
    return FS_LIT(1.0) - (FS_LIT(0.5) * square - square * (square * sum));
}

void fs_sin_cos(fs_real angle_rad, fs_real *sine_out, fs_real *cosine_out)
{
    fs_real turns, angle, square, sine, cosine;
    uint16_t quadrant;

    if (!(fs_abs(angle_rad) <= FS_LARGEST_ANGLE_RAD)) {
        const fs_real infinite = fs_abs(angle_rad) * FS_REAL_MAX;
        *sine_out = infinite - infinite;
        *cosine_out = *sine_out;
        return;
    }
    turns = angle_rad * FS_LIT(0.6366197723675814); /* 2/pi */
    turns = turns < FS_LIT(0.0) ? turns - FS_LIT(0.5) : turns + FS_LIT(0.5);
    quadrant = (uint16_t)(int16_t)turns;
    turns = (fs_real)(int16_t)turns;
    angle = ((angle_rad - turns * HALF_PI_1) - turns * HALF_PI_2) - turns * HALF_PI_3;
    square = angle * angle;
    sine = sine_of_small(angle, square);
    cosine = cosine_of_small(square);
    switch (quadrant & 3U) {
    case 0U:
        *sine_out = sine;
        *cosine_out = cosine;
        break;
    case 1U:
        *sine_out = cosine;
        *cosine_out = -sine;
        break;
    case 2U:
        *sine_out = -sine;
        *cosine_out = -cosine;
        break;
    default:
        *sine_out = -cosine;
        *cosine_out = sine;
        break;
    }
}
