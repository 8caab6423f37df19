#ifndef FS_FRAME_H
#define FS_FRAME_H

#include "fs_wire.h"

/*
 * Frames of MAVLink 1 and 2: a header, a payload and a checksum around them.
 * https://mavlink.io/en/guide/serialization.html
 */

#define FS_MAGIC_V1 0xFEU
#define FS_MAGIC_V2 0xFDU
#define FS_HEADER_V1 6U      /* octets before the payload */
#define FS_HEADER_V2 10U
#define FS_CHECKSUM_SIZE 2U
#define FS_SIGNATURE_SIZE 13U
#define FS_FLAG_SIGNED 0x01U /* the one incompatibility flag that the specification defines */
#define FS_MAX_FRAME (FS_HEADER_V2 + FS_MAX_PAYLOAD + FS_CHECKSUM_SIZE + FS_SIGNATURE_SIZE)

/* A frame as it was received: every element is an octet with clean high bits. */
typedef struct {
    uint32_t id; /* of the message */
    uint16_t system, component, sequence;
    uint16_t length; /* of the payload as it came; beyond it the payload is not written */
    fs_octet payload[FS_MAX_PAYLOAD];
} fs_frame;

#define FS_CRC_START 0xFFFFU

/* Return the checksum (CRC-16/MCRF4XX, begun with FS_CRC_START) after one octet more, or after count more. */
uint16_t fs_crc_add(uint16_t crc, fs_octet octet);
uint16_t fs_crc_add_all(uint16_t crc, const fs_octet *octets, uint16_t count);

/*
 * Write an unsigned frame of MAVLink 2 into out, which has room for FS_MAX_FRAME, and return its size in octets:
 * 0, with nothing written, for a message that the codec has not got or for more than FS_MAX_PAYLOAD octets.
 * Sequence, system and component count modulo 256.
 */
uint16_t fs_frame_encode(fs_octet *out, uint32_t id, uint16_t sequence, uint16_t system, uint16_t component,
                         const fs_octet *payload, uint16_t length);

#endif
