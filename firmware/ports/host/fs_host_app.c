#include <stdlib.h>

#include "fs_host.h"

#define PIECE 256U /* octets handed on at once */

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
