#include "fs_frame.h"

#include "fs_messages.h"

uint16_t fs_crc_add(uint16_t crc, fs_octet octet)
{
    uint16_t mixed = (uint16_t)(octet ^ crc);

    /* eight shifts in closed form, without a table that would need RAM on an AVR; high bits drop out here */
    mixed = (uint16_t)((mixed ^ (uint16_t)(mixed << 4)) & 0xFFU);
    return (uint16_t)((crc >> 8) ^ (uint16_t)(mixed << 8) ^ (uint16_t)(mixed << 3) ^ (mixed >> 4));
}

uint16_t fs_crc_add_all(uint16_t crc, const fs_octet *octets, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        crc = fs_crc_add(crc, octets[i]);
    }
    return crc;
}

uint16_t fs_frame_encode(fs_octet *out, uint32_t id, uint16_t sequence, uint16_t system, uint16_t component,
                         const fs_octet *payload, uint16_t length)
{
    fs_message_kind kind;
    uint16_t crc, end = (uint16_t)(FS_HEADER_V2 + length);

    if ((length > FS_MAX_PAYLOAD) || (fs_message_kind_of(id, &kind) == 0U)) {
        return 0U;
    }
    out[0] = FS_MAGIC_V2;
    out[1] = length;
    out[2] = 0U; /* flags that a receiver must understand */
    out[3] = 0U; /* flags that it may ignore */
    fs_put_octet(&out[4], sequence);
    fs_put_octet(&out[5], system);
    fs_put_octet(&out[6], component);
    fs_put_u16(&out[7], (uint16_t)(id & 0xFFFFUL));
    fs_put_octet(&out[9], (fs_octet)(id >> 16));
    fs_put_octets(&out[FS_HEADER_V2], payload, length);
    crc = fs_crc_add_all(FS_CRC_START, &out[1], (uint16_t)(end - 1U));
    fs_put_u16(&out[end], fs_crc_add(crc, kind.crc_extra));
    return (uint16_t)(end + FS_CHECKSUM_SIZE);
}
