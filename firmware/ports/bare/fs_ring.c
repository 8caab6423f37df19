#include "fs_ring.h"

void fs_ring_init(fs_ring *ring, volatile fs_octet *octets, uint16_t size)
{
    ring->octets = octets;
    ring->size = size;
    ring->written = 0U;
    ring->read = 0U;
}

uint16_t fs_ring_held(const fs_ring *ring)
{
    const uint16_t written = ring->written;
    const uint16_t read = ring->read;

    return (uint16_t)(((uint32_t)written - read) & 0xFFFFUL);
}

uint16_t fs_ring_room(const fs_ring *ring)
{
    return (uint16_t)(ring->size - fs_ring_held(ring));
}

uint16_t fs_ring_put(fs_ring *ring, fs_octet octet)
{
    const uint16_t at = ring->written;

    if (fs_ring_held(ring) >= ring->size) {
        return 0U;
    }
    ring->octets[at & (ring->size - 1U)] = octet & 0xFFU;
    ring->written = (uint16_t)(((uint32_t)at + 1UL) & 0xFFFFUL); /* last: from here on the other side sees it */
    return 1U;
}

uint16_t fs_ring_take(fs_ring *ring, fs_octet *octet)
{
    const uint16_t at = ring->read;

    if (fs_ring_held(ring) == 0U) {
        return 0U;
    }
    *octet = ring->octets[at & (ring->size - 1U)];
    ring->read = (uint16_t)(((uint32_t)at + 1UL) & 0xFFFFUL); /* last: from here on the other side may overwrite it */
    return 1U;
}
