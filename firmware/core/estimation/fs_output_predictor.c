/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * The output at the rate of the IMU: integrates each sample and follows the filter, which is late by its delay.
 * flightstack/estimation/output_predictor.py
 */
#include "fs_output_predictor.h"

#include "fs_error_state.h"
#include "fs_geometry.h"
#include "fs_math.h"
#include "fs_rings.h"

#define FS_IMU_RING 4
#define FS_IMU_ROWS 64

/* output_predictor.py:29 */
void fs_write_motion(fs_real row[], fs_real time_s, const fs_motion *motion)
{
    const fs_quaternion *q = &motion->attitude;
    row[0] = time_s;
    row[1] = q->w;
    row[2] = q->x;
    row[3] = q->y;
    row[4] = q->z;
    fs_write_vector(row, 5, &motion->velocity_ned_m_s);
    fs_write_vector(row, 8, &motion->position_ned_m);
}

/* output_predictor.py:23 */
fs_motion fs_read_motion(const fs_real row[])
{
    return (fs_motion){
        .attitude = {row[1], row[2], row[3], row[4]},
        .velocity_ned_m_s = fs_read_vector(row, 5),
        .position_ned_m = fs_read_vector(row, 8),
    };
}

/* output_predictor.py:128 */
static fs_vector3 between(const fs_vector3 *a, const fs_vector3 *b, fs_real share)
{
    return (fs_vector3){
        .x = a->x + share * (b->x - a->x),
        .y = a->y + share * (b->y - a->y),
        .z = a->z + share * (b->z - a->z),
    };
}

/* Return the change from a state to another one that is turned by turn. output_predictor.py:64 */
static fs__change change(const fs_quaternion *turn, const fs_motion *before, const fs_motion *after, fs_real start_s)
{
    const fs_vector3 v_2 = {FS_LIT(1.0), FS_LIT(0.0), FS_LIT(0.0)};
    const fs_vector3 x = fs_rotate(turn, &v_2);
    const fs_vector3 v_3 = {FS_LIT(0.0), FS_LIT(1.0), FS_LIT(0.0)};
    const fs_vector3 y = fs_rotate(turn, &v_3);
    const fs_vector3 z = fs_cross(&x, &y);
    const fs_vector3 u = fs_rotate(turn, &before->velocity_ned_m_s);
    const fs_vector3 *v = &after->velocity_ned_m_s;
    return (fs__change){
        .turn = *turn,
        .north = {x.x, y.x, z.x},
        .east = {x.y, y.y, z.y},
        .down = {x.z, y.z, z.z},
        .speed_m_s = {v->x - u.x, v->y - u.y, v->z - u.z},
        .before_m = before->position_ned_m,
        .after_m = after->position_ned_m,
        .start_s = start_s,
    };
}

/* output_predictor.py:55 */
static fs_vector3 turned_by(const fs__change *c, fs_real x, fs_real y, fs_real z)
{
    return (fs_vector3){
        .x = c->north.x * x + c->north.y * y + c->north.z * z,
        .y = c->east.x * x + c->east.y * y + c->east.z * z,
        .z = c->down.x * x + c->down.y * y + c->down.z * z,
    };
}

/*
 * Move a row that followed from the state before the change so that it follows from the one after it.
 *
 * Its specific force turns too; free fall does not.
 *
 * output_predictor.py:83
 */
static void replayed(fs_real row[], const fs__change *c, fs_real gravity)
{
    const fs_motion late = fs_read_motion(row);
    const fs_real age_s = row[0] - c->start_s;
    const fs_vector3 *v = &late.velocity_ned_m_s;
    const fs_vector3 *q = &late.position_ned_m;
    const fs_vector3 *before = &c->before_m;
    const fs_vector3 *after = &c->after_m;
    const fs_vector3 *u = &c->speed_m_s;
    const fs_real fall = gravity * age_s;
    const fs_real drop = FS_LIT(0.5) * fall * age_s;
    const fs_vector3 dv = turned_by(c, v->x, v->y, v->z - fall);
    const fs_vector3 dp = turned_by(c, q->x - before->x, q->y - before->y, q->z - before->z - drop);
    const fs_vector3 velocity = {u->x + dv.x, u->y + dv.y, u->z + dv.z + fall};
    const fs_vector3 place = {
        .x = after->x + u->x * age_s + dp.x,
        .y = after->y + u->y * age_s + dp.y,
        .z = after->z + u->z * age_s + dp.z + drop,
    };
    const fs_motion motion = {
        .attitude = fs_quaternion_product(&c->turn, &late.attitude),
        .velocity_ned_m_s = velocity,
        .position_ned_m = place,
    };
    fs_write_motion(row, row[0], &motion);
}

/* output_predictor.py:103 */
void fs_follow(fs_rings *rings, fs_real output[], const fs_motion *target, fs_real share, fs_real gravity)
{
    fs_real *oldest = rings->track[fs_oldest_slot(rings, FS_IMU_RING)];
    const fs_motion start = fs_read_motion(oldest);
    const fs_real start_s = oldest[0];
    const fs_quaternion conjugate = fs_conjugate(&start.attitude);
    const fs_quaternion quaternion_product = fs_quaternion_product(&target->attitude, &conjugate);
    const fs_vector3 turn = fs_rotation_vector(&quaternion_product);
    const fs_quaternion correction = fs_rotation_over(&turn, share);
    const fs_motion after = {
        .attitude = fs_quaternion_product(&correction, &start.attitude),
        .velocity_ned_m_s = between(&start.velocity_ned_m_s, &target->velocity_ned_m_s, share),
        .position_ned_m = between(&start.position_ned_m, &target->position_ned_m, share),
    };
    const fs__change change_ = change(&correction, &start, &after, start_s);
    for (int32_t number = 0; number < 64; number++) {
        if (number >= fs_count_of(rings, FS_IMU_RING)) {
            break;
        }
        fs_real *row = rings->track[fs_slot_of(rings, FS_IMU_RING, FS_IMU_ROWS, number)];
        replayed(row, &change_, gravity);
    }
    replayed(output, &change_, gravity);
}
