#include "fs_outbox.h"

#include "fs_app.h"

void fs_outbox_init(fs_outbox *box)
{
    box->first = 0U;
    box->count = 0U;
    box->sequence = 0U;
    box->dropped = 0UL;
}

uint16_t fs_outbox_put(fs_outbox *box, uint32_t id, const fs_octet *payload, uint16_t length, uint16_t reserve)
{
    uint16_t at, i, size;

    size = fs_frame_encode(box->frame, id, box->sequence, FS_APP_SYSTEM, FS_APP_COMPONENT, payload, length);
    if ((uint16_t)(box->count + size + reserve) > FS_OUTBOX_SIZE) {
        box->dropped++;
        return 0U;
    }
    at = (uint16_t)((box->first + box->count) % FS_OUTBOX_SIZE);
    for (i = 0U; i < size; i++) {
        box->octets[at] = box->frame[i];
        at = (uint16_t)((at + 1U) % FS_OUTBOX_SIZE);
    }
    box->count = (uint16_t)(box->count + size);
    box->sequence = (uint16_t)((box->sequence + 1U) & 0xFFU);
    return 1U;
}

uint16_t fs_outbox_room(const fs_outbox *box)
{
    return (uint16_t)(FS_OUTBOX_SIZE - box->count);
}

uint16_t fs_outbox_take(fs_outbox *box, fs_octet *out, uint16_t room)
{
    uint16_t i, taken = (box->count < room) ? box->count : room;

    for (i = 0U; i < taken; i++) {
        out[i] = box->octets[box->first];
        box->first = (uint16_t)((box->first + 1U) % FS_OUTBOX_SIZE);
    }
    box->count = (uint16_t)(box->count - taken);
    return taken;
}
