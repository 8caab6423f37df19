/* The host as a target: its port for the application, and applications with memory of their own. */
#ifndef FS_HOST_H
#define FS_HOST_H

#include "fs_app.h"

/* The host as a port: costs in nanoseconds of the monotonic clock; its stack is not measured. */
const fs_port *fs_host_port(void);

uint32_t fs_host_nanoseconds(void); /* modulo 2^32 */
uint32_t fs_host_microseconds(void);
uint32_t fs_host_milliseconds(void);

/* An application, on the host's port when port is NULL; NULL when there is no memory. The port must outlive it. */
fs_app *fs_host_app_new(const fs_port *port);
void fs_host_app_free(fs_app *app);

/* fs_app_receive for many octets, and fs_app_transmit, with octets as a byte string has them. */
void fs_host_app_receive(fs_app *app, const unsigned char *octets, uint32_t count);
uint32_t fs_host_app_transmit(fs_app *app, unsigned char *out, uint32_t room);

#endif
