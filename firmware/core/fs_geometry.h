/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Quaternions, Euler angles and vectors for compiled code. flightstack/core/geometry.py */
#ifndef FS_GEOMETRY_H
#define FS_GEOMETRY_H

#include "fs_math.h"
#include "fs_types.h"

#define FS_GEOMETRY_LARGEST_SQUARE FS_LIT(0.1715)
#define FS_GEOMETRY_LEAST_LENGTH FS_LIT(1e-30)
#define FS_GEOMETRY_SMALL_SQUARE FS_LIT(0.01)

/*
 * Logarithm of a quaternion of any length: axis times angle [rad], angle in [0, pi]; zero for the zero quaternion.
 *
 * For a single axis it equals the Euler angle, as in the paper's errors.
 *
 * geometry.py:84
 */
static inline fs_vector3 fs_rotation_vector(const fs_quaternion *q)
{
    const fs_real square = q->x * q->x + q->y * q->y + q->z * q->z;
    const fs_real w_square = q->w * q->w;
    fs_real inverse;
    fs_real ratio_square;
    fs_real scale;
    /* below 45 degrees: 2 atan(norm / w) / norm, without the norm */
    if (square < FS_GEOMETRY_LARGEST_SQUARE * w_square) {
        inverse = FS_LIT(1.0) / q->w;
        ratio_square = square * inverse * inverse;
        scale = FS_LIT(2.0) * inverse;
    } else {
        /* the tangent of an eighth of the angle: tan(a/2) = sin a / (cos a + 1), twice */
        const fs_real half = fs_abs(q->w) + fs_sqrt(w_square + square);
        const fs_real quarter = half + fs_sqrt(half * half + square);
        inverse = FS_LIT(1.0) / fs_max(quarter, FS_GEOMETRY_LEAST_LENGTH);
        ratio_square = square * inverse * inverse;
        scale = q->w >= FS_LIT(0.0) ? FS_LIT(8.0) * inverse : FS_LIT(-8.0) * inverse;
    }
    scale = scale + scale * fs_arc_tangent_series(ratio_square);
    return (fs_vector3){q->x * scale, q->y * scale, q->z * scale};
}

/* Hamilton product a (x) b: first the rotation b, then a. geometry.py:34 */
static inline fs_quaternion fs_quaternion_product(const fs_quaternion *a, const fs_quaternion *b)
{
    return (fs_quaternion){
        .w = a->w * b->w - a->x * b->x - a->y * b->y - a->z * b->z,
        .x = a->w * b->x + a->x * b->w + a->y * b->z - a->z * b->y,
        .y = a->w * b->y - a->x * b->z + a->y * b->w + a->z * b->x,
        .z = a->w * b->z + a->x * b->y - a->y * b->x + a->z * b->w,
    };
}

/* Return the inverse rotation of a unit quaternion. geometry.py:45 */
static inline fs_quaternion fs_conjugate(const fs_quaternion *q)
{
    return (fs_quaternion){q->w, -q->x, -q->y, -q->z};
}

/* Scale q to unit length; the identity when its length is zero. geometry.py:51 */
static inline fs_quaternion fs_normalised(const fs_quaternion *q)
{
    const fs_real norm = fs_sqrt(q->w * q->w + q->x * q->x + q->y * q->y + q->z * q->z);
    if (norm == FS_LIT(0.0)) {
        return (fs_quaternion){FS_LIT(1.0), FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};
    }
    const fs_real scale = FS_LIT(1.0) / norm;
    return (fs_quaternion){q->w * scale, q->x * scale, q->y * scale, q->z * scale};
}

/* Rotation by constant body rates over dt_s; with dt_s = 1 the exponential of a rotation vector. geometry.py:105 */
static inline fs_quaternion fs_rotation_over(const fs_vector3 *rates, fs_real dt_s)
{
    const fs_real rate_square = rates->x * rates->x + rates->y * rates->y + rates->z * rates->z;
    const fs_real half_dt = FS_LIT(0.5) * dt_s;
    const fs_real square = rate_square * (half_dt * half_dt);
    fs_real sine;
    fs_real w;
    fs_real scale;
    if (square <= FS_GEOMETRY_SMALL_SQUARE) { /* Taylor's series of cosine and of sine by angle: no norm needed */
        const fs_real cosine = (square * (FS_LIT(1.0) / FS_LIT(40320.0)) - FS_LIT(1.0) / FS_LIT(720.0)) * square +
                               FS_LIT(1.0) / FS_LIT(24.0);
        sine = ((square * (FS_LIT(1.0) / FS_LIT(362880.0)) - FS_LIT(1.0) / FS_LIT(5040.0)) * square +
                FS_LIT(1.0) / FS_LIT(120.0)) * square - FS_LIT(1.0) / FS_LIT(6.0);
        w = FS_LIT(1.0) - (FS_LIT(0.5) * square - square * (square * cosine));
        scale = half_dt + half_dt * (square * sine);
    } else {
        const fs_real norm = fs_sqrt(rate_square);
        fs_sin_cos(norm * half_dt, &sine, &w);
        scale = sine / norm;
    }
    return (fs_quaternion){w, rates->x * scale, rates->y * scale, rates->z * scale};
}

/* Vector product a x b. geometry.py:28 */
static inline fs_vector3 fs_cross(const fs_vector3 *a, const fs_vector3 *b)
{
    return (fs_vector3){
        .x = a->y * b->z - a->z * b->y,
        .y = a->z * b->x - a->x * b->z,
        .z = a->x * b->y - a->y * b->x,
    };
}

/* Rotate a body vector to the world frame. geometry.py:61 */
static inline fs_vector3 fs_rotate(const fs_quaternion *q, const fs_vector3 *v)
{
    /* v + 2 w (u x v) + 2 u x (u x v), with q = (w, u) */
    const fs_vector3 u = {q->x, q->y, q->z};
    const fs_vector3 t = fs_cross(&u, v);
    const fs_vector3 tt = fs_cross(&u, &t);
    return (fs_vector3){
        .x = v->x + FS_LIT(2.0) * (q->w * t.x + tt.x),
        .y = v->y + FS_LIT(2.0) * (q->w * t.y + tt.y),
        .z = v->z + FS_LIT(2.0) * (q->w * t.z + tt.z),
    };
}

/* Attitude at fraction of the shortest rotation from a to b, for small angles. geometry.py:73 */
static inline fs_quaternion fs_blend(const fs_quaternion *a, const fs_quaternion *b, fs_real fraction)
{
    const fs_real near_ = a->w * b->w + a->x * b->x + a->y * b->y + a->z * b->z;
    const fs_real to = near_ >= FS_LIT(0.0) ? fraction : -fraction;
    const fs_real left = FS_LIT(1.0) - fraction;
    const fs_quaternion q = {
        .w = left * a->w + to * b->w,
        .x = left * a->x + to * b->x,
        .y = left * a->y + to * b->y,
        .z = left * a->z + to * b->z,
    };
    return fs_normalised(&q);
}

#endif
