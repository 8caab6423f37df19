/*
 * The estimator of a target that has room for it: 13.6 KiB of memory, 38 KiB of code on a Cortex-M4.
 *
 * A port that names these two functions in its fs_port runs the estimator for a host, which sends the measurements of
 * the sensors as FS_PIL_SENSE.
 */
#ifndef FS_SENSING_H
#define FS_SENSING_H

#include "fs_messages.h"

/* Take an event; write flags, and state and resets if they may have changed. 0: the event is not valid. */
uint16_t fs_sensing_take(const fs_pil_sense *event, fs_pil_estimate *estimate);

/* Write the words of the memory from words->first on; zero behind its end. */
void fs_sensing_read(fs_pil_memory *words);

#endif
