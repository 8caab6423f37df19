/*
 * Octets that wait for the line: whole frames only, in the order they were put.
 *
 * A frame that does not fit is dropped as a whole and counted. So that what matters fits, less important frames leave
 * room for it: each is put only while more than its reserve stays free.
 */
#ifndef FS_OUTBOX_H
#define FS_OUTBOX_H

#include "fs_frame.h"

#define FS_OUTBOX_SIZE 2048U /* octets: 178 ms at 115200 baud */

/* Reserves, in octets that must stay free. A report's frame has 160: those of a window of 8 have 1280. */
#define FS_OUTBOX_ALARM 0U   /* reason that the rotors are stopped, for every listener */
#define FS_OUTBOX_REPORT 0U  /* reports of steps: what a host waits for in each step */
#define FS_OUTBOX_ANSWER 1344U /* answers to requests, which are asked again when they are lost */
#define FS_OUTBOX_NEWS 1664U  /* heartbeat, status, texts: a later one replaces them */

typedef struct {
    fs_octet octets[FS_OUTBOX_SIZE];
    fs_octet frame[FS_MAX_FRAME]; /* where a frame is made */
    uint16_t first, count;        /* of the octets that wait */
    uint16_t sequence;            /* of the next frame, modulo 256 */
    uint32_t dropped;             /* frames that did not fit */
} fs_outbox;

void fs_outbox_init(fs_outbox *box);

/* Put a frame from this system's autopilot; 0, and counted, when more than `reserve` octets would not stay free. */
uint16_t fs_outbox_put(fs_outbox *box, uint32_t id, const fs_octet *payload, uint16_t length, uint16_t reserve);

/* Return how many octets are free. */
uint16_t fs_outbox_room(const fs_outbox *box);

/* Take at most `room` octets, in order; returns how many. */
uint16_t fs_outbox_take(fs_outbox *box, fs_octet *out, uint16_t room);

#endif
