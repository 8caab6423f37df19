#include "fs_math.h"

/*
 * pi/2 in three parts. The first two are so short that their product with the number of quarter turns, 13 bits for the
 * largest angle, is exact; so are the two differences, and what is left of the angle has almost no error.
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

#define SMALL_ANGLE_RAD FS_LIT(0.78) /* less than pi/4, beyond which there are quarter turns to take off */

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

fs_sine_cosine fs_sin_cos(fs_real angle_rad)
{
    fs_sine_cosine result;
    fs_real turns, angle, square, sine, cosine;
    uint16_t quadrant;

    if (!(fs_abs(angle_rad) <= FS_LARGEST_ANGLE_RAD)) {
        const fs_real infinite = fs_abs(angle_rad) * FS_REAL_MAX;
        result.sine = infinite - infinite;
        result.cosine = result.sine;
        return result;
    }
    if (fs_abs(angle_rad) <= SMALL_ANGLE_RAD) { /* most of the loops' angles: the same result in fewer operations */
        square = angle_rad * angle_rad;
        result.sine = sine_of_small(angle_rad, square);
        result.cosine = cosine_of_small(square);
        return result;
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
        result.sine = sine;
        result.cosine = cosine;
        break;
    case 1U:
        result.sine = cosine;
        result.cosine = -sine;
        break;
    case 2U:
        result.sine = -sine;
        result.cosine = -cosine;
        break;
    default:
        result.sine = -cosine;
        result.cosine = sine;
        break;
    }
    return result;
}

/* Arc tangent of a ratio in [0, 1]: tabulated at eighths, and a series for the sixteenth at most that is left. */
static fs_real atan_of_ratio(fs_real ratio)
{
    static const fs_real at_eighths[9] = {
        FS_LIT(0.0),
        FS_LIT(0.12435499454676144),
        FS_LIT(0.24497866312686414),
        FS_LIT(0.35877067027057225),
        FS_LIT(0.4636476090008061),
        FS_LIT(0.5585993153435624),
        FS_LIT(0.6435011087932844),
        FS_LIT(0.7188299996216245),
        FS_LIT(0.7853981633974483),
    };
    fs_real rest = ratio, tabulated = FS_LIT(0.0), square, sum;

    if (ratio >= FS_LIT(0.0625)) { /* below, the nearest is 0, and nothing of this changes anything */
        const int16_t nearest = (int16_t)(ratio * FS_LIT(8.0) + FS_LIT(0.5));
        const fs_real eighths = (fs_real)nearest * FS_LIT(0.125);
        rest = (ratio - eighths) / (FS_LIT(1.0) + ratio * eighths);
        tabulated = at_eighths[nearest];
    }
    square = rest * rest;
#ifdef FS_DOUBLE
    sum = 1.0 / 13.0;
    sum = sum * square - 1.0 / 11.0;
    sum = sum * square + 1.0 / 9.0;
    sum = sum * square - 1.0 / 7.0;
    sum = sum * square + 1.0 / 5.0;
#else
    sum = 1.0F / 5.0F;
#endif
    sum = sum * square - FS_LIT(1.0) / FS_LIT(3.0);
    return tabulated + (rest + rest * (square * sum));
}

fs_real fs_atan2(fs_real y, fs_real x)
{
    const fs_real along = fs_abs(x), across = fs_abs(y);
    const fs_real larger = fs_max(along, across), smaller = fs_min(along, across);
    fs_real angle;

    if (!fs_is_finite(fs_add_magnitude(fs_add_magnitude(FS_LIT(0.0), x), y))) {
        return (x - x) * (y - y); /* NaN: infinity or NaN less itself */
    }
    if (larger == FS_LIT(0.0)) {
        return FS_LIT(0.0);
    }
    angle = atan_of_ratio(smaller / larger);
    if (across > along) {
        angle = FS_LIT(0.5) * FS_PI - angle;
    }
    if (x < FS_LIT(0.0)) {
        angle = FS_PI - angle;
    }
    return y < FS_LIT(0.0) ? -angle : angle;
}
