/* Quaternions and vectors: flightstack/geometry.py. Hamilton, scalar first, body FRD to world NED.
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

/* Logarithm of a quaternion of any length: axis times angle [rad], the angle in [0, pi]; zero of the zero. */
fs_vector3 fs_rotation_vector(const fs_quaternion *q);

/* Rotation that constant body rates make in dt_s. */
fs_quaternion fs_rotation_over(const fs_vector3 *rates_rad_s, fs_real dt_s);

#endif
