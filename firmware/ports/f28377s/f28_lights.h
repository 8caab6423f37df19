/*
 * The two LEDs. One beats, on or off for 512 ms; the other one is lit in the safe state, and flickers after a restart
 * by the watchdog.
 */
#ifndef F28_LIGHTS_H
#define F28_LIGHTS_H

#include "fs_wire.h"

void f28_lights_init(void);
void f28_lights_show(uint32_t now_ms, uint16_t state); /* state: FS_APP_READY … */

#endif
