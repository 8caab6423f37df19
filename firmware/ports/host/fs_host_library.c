/* The library that Python loads: loops for SIL, and a whole application for tests. */
#include <stdlib.h>

#include "fs_build.h"
#include "fs_host.h"
#include "fs_params.h"

#define PIECE 256U /* octets handed on at once */

uint16_t fs_host_real_octets(void)
{
    return (uint16_t)sizeof(fs_real); /* a host's char has 8 bits */
}

const char *fs_host_compiler(void)
{
    return FS_COMPILER;
}

fs_loops *fs_host_loops_new(void)
{
    fs_loops *loops = malloc(sizeof *loops);

    if (loops != NULL) {
        fs_loops_init(loops);
    }
    return loops;
}

void fs_host_loops_free(fs_loops *loops)
{
    free(loops);
}

static fs_vector3 vector_at(const fs_real *at)
{
    const fs_vector3 vector = {at[0], at[1], at[2]};

    return vector;
}

static fs_quaternion quaternion_at(const fs_real *at)
{
    const fs_quaternion quaternion = {at[0], at[1], at[2], at[3]};

    return quaternion;
}

static fs_real *put_vector(fs_real *at, const fs_vector3 *vector)
{
    at[0] = vector->x;
    at[1] = vector->y;
    at[2] = vector->z;
    return &at[3];
}

static fs_real *put_quaternion(fs_real *at, const fs_quaternion *quaternion)
{
    at[0] = quaternion->w;
    at[1] = quaternion->x;
    at[2] = quaternion->y;
    at[3] = quaternion->z;
    return &at[4];
}

static fs_real *put_wrench(fs_real *at, const fs_wrench *wrench)
{
    at[0] = wrench->thrust_n;
    return put_vector(&at[1], &wrench->torque_frd_n_m);
}

static void put_output(fs_real *at, const fs_loop_output *output)
{
    uint16_t i;

    at = put_quaternion(at, &output->attitude_target.attitude);
    *at = output->attitude_target.thrust_n;
    at = put_quaternion(&at[1], &output->reference.attitude);
    at = put_vector(at, &output->reference.rates_frd_rad_s);
    at = put_vector(at, &output->reference.acceleration_frd_rad_s2);
    at = put_wrench(at, &output->wrench);
    at = put_wrench(at, &output->wrench_achieved);
    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        at[i] = output->rotor_command_rad_s[i];
    }
}

uint16_t fs_host_loops_step(fs_loops *loops, const fs_real *input, uint16_t flags, fs_real *output, uint32_t *costs)
{
    const fs_loop_input in = {
        .state = {vector_at(&input[0]), vector_at(&input[3]), quaternion_at(&input[6]), vector_at(&input[10])},
        .setpoint = {vector_at(&input[13]), vector_at(&input[16]), vector_at(&input[19]), input[22], input[23]},
        .target = {quaternion_at(&input[24]), input[28]},
        .flags = flags,
    };
    fs_loop_output out;
    fs_loop_cost cost;

    fs_loops_step(loops, &in, (costs != NULL) ? fs_host_nanoseconds : NULL, &out, &cost);
    put_output(output, &out);
    if (costs != NULL) {
        costs[0] = cost.outer;
        costs[1] = cost.inner;
        costs[2] = cost.mixer;
        costs[3] = cost.whole;
    }
    return out.status;
}

void fs_host_param_get(const fs_loops *loops, uint16_t index, fs_real *value)
{
    *value = fs_param_get(loops, index);
}

uint16_t fs_host_param_set(fs_loops *loops, uint16_t index, const fs_real *value)
{
    return fs_param_set(loops, index, *value);
}

fs_app *fs_host_app_new(const fs_port *port)
{
    fs_app *app = malloc(sizeof *app);

    if (app != NULL) {
        fs_app_init(app, (port != NULL) ? port : fs_host_port());
    }
    return app;
}

void fs_host_app_free(fs_app *app)
{
    free(app);
}

void fs_host_app_receive(fs_app *app, const unsigned char *octets, uint32_t count)
{
    uint32_t i;

    for (i = 0U; i < count; i++) {
        fs_app_receive(app, octets[i]);
    }
}

uint32_t fs_host_app_transmit(fs_app *app, unsigned char *out, uint32_t room)
{
    fs_octet piece[PIECE];
    uint32_t sent = 0U;
    uint16_t count, i;

    do {
        count = fs_app_transmit(app, piece, (uint16_t)((room - sent < PIECE) ? room - sent : PIECE));
        for (i = 0U; i < count; i++) {
            out[sent + i] = (unsigned char)piece[i];
        }
        sent += count;
    } while (count > 0U);
    return sent;
}
