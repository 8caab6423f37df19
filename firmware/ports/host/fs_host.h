/* The host as a target: its port for the application, and what a library for Python exports. */
#ifndef FS_HOST_H
#define FS_HOST_H

#include "fs_app.h"

/* The host as a port: costs in nanoseconds of the monotonic clock; its stack is not measured. */
const fs_port *fs_host_port(void);

uint32_t fs_host_nanoseconds(void); /* modulo 2^32 */
uint32_t fs_host_milliseconds(void);

/*
 * Library. Everything is called from one thread for one object; objects are independent of each other. Pointers to
 * numbers are to arrays of fs_real: 4 or 8 octets, as fs_host_real_octets tells.
 */
#define FS_HOST_INPUTS 29U  /* state 13, setpoint 11, attitude target 5, in the order of fs_loop_input */
#define FS_HOST_OUTPUTS 31U /* in the order of fs_loop_output */
#define FS_HOST_COSTS 4U    /* nanoseconds of outer loop, inner loop, mixer, whole step */

uint16_t fs_host_real_octets(void);
const char *fs_host_compiler(void);

/* Loops with default numbers; NULL when there is no memory. */
fs_loops *fs_host_loops_new(void);
void fs_host_loops_free(fs_loops *loops);

/* fs_loops_step on flat arrays; costs may be NULL, then no time is measured. Returns the status. */
uint16_t fs_host_loops_step(fs_loops *loops, const fs_real *input, uint16_t flags, fs_real *output, uint32_t *costs);

/* fs_param_get and fs_param_set by address, because Python's ctypes promotes a float passed by value. */
void fs_host_param_get(const fs_loops *loops, uint16_t index, fs_real *value);
uint16_t fs_host_param_set(fs_loops *loops, uint16_t index, const fs_real *value);

/* An application, on the host's port when port is NULL; NULL when there is no memory. The port must outlive it. */
fs_app *fs_host_app_new(const fs_port *port);
void fs_host_app_free(fs_app *app);

/* fs_app_receive for many octets, and fs_app_transmit, with octets as a byte string has them. */
void fs_host_app_receive(fs_app *app, const unsigned char *octets, uint32_t count);
uint32_t fs_host_app_transmit(fs_app *app, unsigned char *out, uint32_t room);

#endif
