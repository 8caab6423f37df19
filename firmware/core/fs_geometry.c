#include "fs_geometry.h"

#include "fs_math.h"

fs_vector3 fs_cross(const fs_vector3 *a, const fs_vector3 *b)
{
    fs_vector3 product;

    product.x = a->y * b->z - a->z * b->y;
    product.y = a->z * b->x - a->x * b->z;
    product.z = a->x * b->y - a->y * b->x;
    return product;
}

fs_quaternion fs_quaternion_product(const fs_quaternion *a, const fs_quaternion *b)
{
    fs_quaternion product;

    product.w = a->w * b->w - a->x * b->x - a->y * b->y - a->z * b->z;
    product.x = a->w * b->x + a->x * b->w + a->y * b->z - a->z * b->y;
    product.y = a->w * b->y - a->x * b->z + a->y * b->w + a->z * b->x;
    product.z = a->w * b->z + a->x * b->y - a->y * b->x + a->z * b->w;
    return product;
}

fs_quaternion fs_conjugate(const fs_quaternion *q)
{
    fs_quaternion inverse;

    inverse.w = q->w;
    inverse.x = -q->x;
    inverse.y = -q->y;
    inverse.z = -q->z;
    return inverse;
}

fs_quaternion fs_normalised(const fs_quaternion *q)
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

fs_vector3 fs_rotate(const fs_quaternion *q, const fs_vector3 *v)
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

fs_quaternion fs_blend(const fs_quaternion *a, const fs_quaternion *b, fs_real fraction)
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
