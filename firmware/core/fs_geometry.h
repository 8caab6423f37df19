/* Quaternions and vectors: flightstack/geometry.py. Hamilton, scalar first, body FRD to world NED. */
#ifndef FS_GEOMETRY_H
#define FS_GEOMETRY_H

#include "fs_math.h"
#include "fs_types.h"

fs_vector3 fs_cross(const fs_vector3 *a, const fs_vector3 *b);

/* Hamilton product a * b: first the rotation b, then a. */
fs_quaternion fs_quaternion_product(const fs_quaternion *a, const fs_quaternion *b);

/* The inverse rotation of a unit quaternion. */
fs_quaternion fs_conjugate(const fs_quaternion *q);

/* Scaled to unit length; the identity when the length is zero. */
fs_quaternion fs_normalised(const fs_quaternion *q);

/* A body vector in the world frame. */
fs_vector3 fs_rotate(const fs_quaternion *q, const fs_vector3 *v);

/* Attitude at a fraction of the short way from a to b, for small angles between them. */
fs_quaternion fs_blend(const fs_quaternion *a, const fs_quaternion *b, fs_real fraction);

/* Logarithm of a unit quaternion: axis times angle [rad], the angle in [0, pi]. */
fs_vector3 fs_rotation_vector(const fs_quaternion *q);

/* Rotation that constant body rates make in dt_s. */
fs_quaternion fs_rotation_over(const fs_vector3 *rates_rad_s, fs_real dt_s);

/* Quaternion of yaw, then pitch, then roll (3-2-1). */
fs_quaternion fs_quaternion_from_euler(fs_real roll_rad, fs_real pitch_rad, fs_real yaw_rad);

static inline uint16_t fs_vector_is_finite(const fs_vector3 *v)
{
    return (fs_is_finite(v->x) && fs_is_finite(v->y) && fs_is_finite(v->z)) ? 1U : 0U;
}

static inline uint16_t fs_quaternion_is_finite(const fs_quaternion *q)
{
    return (fs_is_finite(q->w) && fs_is_finite(q->x) && fs_is_finite(q->y) && fs_is_finite(q->z)) ? 1U : 0U;
}

#endif
