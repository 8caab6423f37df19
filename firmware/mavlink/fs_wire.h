#ifndef FS_WIRE_H
#define FS_WIRE_H

#include <stdint.h>

/*
 * Numbers to octets and back, little-endian, whatever the size of a char.
 *
 * An octet is one array element of at least 16 bits, because nothing smaller exists on a C28x. Its high bits may
 * hold anything on input: every function masks them. On output they are zero.
 */

typedef uint16_t fs_octet;

/* 64-bit fields are only passed on, never computed with; a C28x has no use for uint64_t here. */
typedef struct {
    uint32_t low, high;
} fs_uint64;

#define FS_MAX_PAYLOAD 255U /* octets of the longest payload of any message */

/* The bits of a float as an integer, and back. NaN payloads and the sign of zero survive. */
uint32_t fs_float_bits(float value);
float fs_bits_float(uint32_t bits);

/* Write one number, or count numbers, at `at`. Of an octet the low 8 bits are written. */
void fs_put_octet(fs_octet *at, fs_octet value);
void fs_put_u16(fs_octet *at, uint16_t value);
void fs_put_i16(fs_octet *at, int16_t value);
void fs_put_u32(fs_octet *at, uint32_t value);
void fs_put_i32(fs_octet *at, int32_t value);
void fs_put_u64(fs_octet *at, fs_uint64 value);
void fs_put_float(fs_octet *at, float value);
void fs_put_octets(fs_octet *at, const fs_octet *values, uint16_t count);
void fs_put_u32s(fs_octet *at, const uint32_t *values, uint16_t count);
void fs_put_floats(fs_octet *at, const float *values, uint16_t count);

/* Read one number, or count numbers, at offset of a payload of length octets; beyond its end all octets are 0. */
fs_octet fs_get_octet(const fs_octet *payload, uint16_t length, uint16_t offset);
uint16_t fs_get_u16(const fs_octet *payload, uint16_t length, uint16_t offset);
int16_t fs_get_i16(const fs_octet *payload, uint16_t length, uint16_t offset);
uint32_t fs_get_u32(const fs_octet *payload, uint16_t length, uint16_t offset);
int32_t fs_get_i32(const fs_octet *payload, uint16_t length, uint16_t offset);
fs_uint64 fs_get_u64(const fs_octet *payload, uint16_t length, uint16_t offset);
float fs_get_float(const fs_octet *payload, uint16_t length, uint16_t offset);
void fs_get_octets(const fs_octet *payload, uint16_t length, uint16_t offset, fs_octet *values, uint16_t count);
void fs_get_u32s(const fs_octet *payload, uint16_t length, uint16_t offset, uint32_t *values, uint16_t count);
void fs_get_floats(const fs_octet *payload, uint16_t length, uint16_t offset, float *values, uint16_t count);

/* Return how much of a payload is to be sent: without the zeros at its end, but one octet at least. */
uint16_t fs_trimmed(const fs_octet *payload, uint16_t length);

/*
 * Text in a field of room octets: filled up with zeros, and without a zero at the end when it fits exactly, as
 * MAVLink has it. fs_text_put cuts text that is too long. fs_text_get writes room characters and a NUL into out,
 * which therefore has to hold room + 1; what is not ASCII becomes '?', because the sign of a char is nobody's
 * promise.
 */
void fs_text_put(fs_octet *field, uint16_t room, const char *text);
void fs_text_get(const fs_octet *field, uint16_t room, char *out);

#endif
