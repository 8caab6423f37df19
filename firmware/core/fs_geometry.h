/* Quaternions and vectors: flightstack/core/geometry.py. Hamilton, scalar first, body FRD to world NED.
 *
 * What is called often and is short stands here, so that it costs no call.
 */
#ifndef FS_GEOMETRY_H
#define FS_GEOMETRY_H

#include "fs_math.h"
#include "fs_types.h"

static inline fs_vector3 fs_cross(const fs_vector3 *a, const fs_vector3 *b)
{
    fs_vector3 product;

    product.x = a->y * b->z - a->z * b->y;
    product.y = a->z * b->x - a->x * b->z;
    product.z = a->x * b->y - a->y * b->x;
    return product;
}

/* Hamilton product a * b: first the rotation b, then a. */
static inline fs_quaternion fs_quaternion_product(const fs_quaternion *a, const fs_quaternion *b)
{
    fs_quaternion product;

    product.w = a->w * b->w - a->x * b->x - a->y * b->y - a->z * b->z;
    product.x = a->w * b->x + a->x * b->w + a->y * b->z - a->z * b->y;
    product.y = a->w * b->y - a->x * b->z + a->y * b->w + a->z * b->x;
    product.z = a->w * b->z + a->x * b->y - a->y * b->x + a->z * b->w;
    return product;
}

/* The inverse rotation of a unit quaternion. */
static inline fs_quaternion fs_conjugate(const fs_quaternion *q)
{
    fs_quaternion inverse;

    inverse.w = q->w;
    inverse.x = -q->x;
    inverse.y = -q->y;
    inverse.z = -q->z;
    return inverse;
}

/* Scaled to unit length; the identity when the length is zero. */
static inline fs_quaternion fs_normalised(const fs_quaternion *q)
{
    const fs_real norm = fs_sqrt(q->w * q->w + q->x * q->x + q->y * q->y + q->z * q->z);
    fs_quaternion unit = {FS_LIT(1.0), FS_LIT(0.0), FS_LIT(0.0), FS_LIT(0.0)};

    if (norm != FS_LIT(0.0)) {
        const fs_real scale = FS_LIT(1.0) / norm;
        unit.w = q->w * scale;
        unit.x = q->x * scale;
        unit.y = q->y * scale;
        unit.z = q->z * scale;
    }
    return unit;
}

/* A body vector in the world frame. */
static inline fs_vector3 fs_rotate(const fs_quaternion *q, const fs_vector3 *v)
{
    /* v + 2 w (u x v) + 2 u x (u x v), with q = (w, u) */
    const fs_vector3 u = {q->x, q->y, q->z};
    const fs_vector3 t = fs_cross(&u, v);
    const fs_vector3 tt = fs_cross(&u, &t);
    fs_vector3 turned;

    turned.x = v->x + FS_LIT(2.0) * (q->w * t.x + tt.x);
    turned.y = v->y + FS_LIT(2.0) * (q->w * t.y + tt.y);
    turned.z = v->z + FS_LIT(2.0) * (q->w * t.z + tt.z);
    return turned;
}

/* Attitude at a fraction of the short way from a to b, for small angles between them. */
static inline fs_quaternion fs_blend(const fs_quaternion *a, const fs_quaternion *b, fs_real fraction)
{
    const fs_real near = a->w * b->w + a->x * b->x + a->y * b->y + a->z * b->z;
    const fs_real to = near >= FS_LIT(0.0) ? fraction : -fraction;
    const fs_real left = FS_LIT(1.0) - fraction;
    fs_quaternion between;

    between.w = left * a->w + to * b->w;
    between.x = left * a->x + to * b->x;
    between.y = left * a->y + to * b->y;
    between.z = left * a->z + to * b->z;
    return fs_normalised(&between);
}

#define FS_LARGEST_SQUARE FS_LIT(0.1715) /* of the tangent of half an angle up to 45 degrees */
#define FS_LEAST_LENGTH FS_LIT(1e-30)    /* stands for zero where one divides by a length */

/* Logarithm of a quaternion of any length: axis times angle [rad], the angle in [0, pi]; zero of the zero. */
static inline fs_vector3 fs_rotation_vector(const fs_quaternion *q)
{
    const fs_real square = q->x * q->x + q->y * q->y + q->z * q->z, w_square = q->w * q->w;
    fs_real inverse, ratio_square, scale;
    fs_vector3 vector;

    if (square < FS_LARGEST_SQUARE * w_square) { /* below 45 degrees: 2 atan(norm / w) / norm, without the norm */
        inverse = FS_LIT(1.0) / q->w;
        ratio_square = square * inverse * inverse;
        scale = FS_LIT(2.0) * inverse;
    } else { /* the tangent of an eighth of the angle: tan(a/2) = sin a / (cos a + 1), twice */
        const fs_real half = fs_abs(q->w) + fs_sqrt(w_square + square);
        const fs_real quarter = half + fs_sqrt(half * half + square);
        inverse = FS_LIT(1.0) / fs_max(quarter, FS_LEAST_LENGTH);
        ratio_square = square * inverse * inverse;
        scale = q->w >= FS_LIT(0.0) ? FS_LIT(8.0) * inverse : FS_LIT(-8.0) * inverse;
    }
    scale = scale + scale * fs_arc_tangent_series(ratio_square);
    vector.x = q->x * scale;
    vector.y = q->y * scale;
    vector.z = q->z * scale;
    return vector;
}

#define FS_SMALL_SQUARE FS_LIT(0.01) /* of half the angle of a short step: 11 degrees */

/* Rotation that constant body rates make in dt_s. */
static inline fs_quaternion fs_rotation_over(const fs_vector3 *rates_rad_s, fs_real dt_s)
{
    const fs_real rate_square =
        rates_rad_s->x * rates_rad_s->x + rates_rad_s->y * rates_rad_s->y + rates_rad_s->z * rates_rad_s->z;
    const fs_real half_dt = FS_LIT(0.5) * dt_s, square = rate_square * (half_dt * half_dt);
    fs_quaternion rotation;
    fs_real scale;

    if (square <= FS_SMALL_SQUARE) { /* Taylor's series of cosine and of sine by angle: no norm needed */
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
        fs_real sine;
        fs_sin_cos(norm * half_dt, &sine, &rotation.w);
        scale = sine / norm;
    }
    rotation.x = rates_rad_s->x * scale;
    rotation.y = rates_rad_s->y * scale;
    rotation.z = rates_rad_s->z * scale;
    return rotation;
}

#endif
