/*
 * A ring of octets between an interrupt and the main loop: one of them writes, the other reads, without a lock.
 *
 * The two counts run freely modulo 2^16, each is written by one side only and read in one instruction; their difference
 * is what the ring holds, so that it may be filled to its last place.
 */
#ifndef FS_RING_H
#define FS_RING_H

#include "fs_wire.h"

typedef struct {
    volatile uint16_t written, read;
    uint16_t size; /* a power of two, 2^15 at most */
    volatile fs_octet *octets;
} fs_ring;

void fs_ring_init(fs_ring *ring, volatile fs_octet *octets, uint16_t size);
uint16_t fs_ring_held(const fs_ring *ring);
uint16_t fs_ring_room(const fs_ring *ring);

/* Put one octet at the end; return 0, without effect, if the ring is full. */
uint16_t fs_ring_put(fs_ring *ring, fs_octet octet);

/* Take the oldest octet; 0, and *octet is unchanged, when the ring is empty. */
uint16_t fs_ring_take(fs_ring *ring, fs_octet *octet);

#endif
