#include "fs_wire.h"

#include <stddef.h>

/* As the standard allows, declared here: a freestanding compiler has no string.h, but every one has memcpy. */
void *memcpy(void *to, const void *from, size_t size);

/* The only two places where memory is copied as it lies: both sides have 32 bits on every target. */
uint32_t fs_float_bits(float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    return bits;
}

float fs_bits_float(uint32_t bits)
{
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

void fs_put_octet(fs_octet *at, fs_octet value)
{
    at[0] = (fs_octet)(value & 0xFFU);
}

void fs_put_u16(fs_octet *at, uint16_t value)
{
    at[0] = (fs_octet)(value & 0xFFU);
    at[1] = (fs_octet)((value >> 8) & 0xFFU);
}

void fs_put_i16(fs_octet *at, int16_t value)
{
    fs_put_u16(at, (uint16_t)value);
}

void fs_put_u32(fs_octet *at, uint32_t value)
{
    fs_put_u16(at, (uint16_t)(value & 0xFFFFUL));
    fs_put_u16(&at[2], (uint16_t)(value >> 16));
}

void fs_put_i32(fs_octet *at, int32_t value)
{
    fs_put_u32(at, (uint32_t)value);
}

void fs_put_u64(fs_octet *at, fs_uint64 value)
{
    fs_put_u32(at, value.low);
    fs_put_u32(&at[4], value.high);
}

void fs_put_float(fs_octet *at, float value)
{
    fs_put_u32(at, fs_float_bits(value));
}

void fs_put_octets(fs_octet *at, const fs_octet *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        fs_put_octet(&at[i], values[i]);
    }
}

void fs_put_u32s(fs_octet *at, const uint32_t *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        fs_put_u32(&at[4U * i], values[i]);
    }
}

void fs_put_floats(fs_octet *at, const float *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        fs_put_float(&at[4U * i], values[i]);
    }
}

fs_octet fs_get_octet(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    fs_octet octet = 0U;

    if (offset < length) {
        octet = (fs_octet)(payload[offset] & 0xFFU);
    }
    return octet;
}

uint16_t fs_get_u16(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    uint16_t low = fs_get_octet(payload, length, offset);
    uint16_t high = fs_get_octet(payload, length, (uint16_t)(offset + 1U));

    return (uint16_t)(low | (uint16_t)(high << 8));
}

int16_t fs_get_i16(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    uint16_t bits = fs_get_u16(payload, length, offset);
    int16_t value;

    /* without a conversion whose result the implementation defines */
    if (bits < 0x8000U) {
        value = (int16_t)bits;
    } else {
        value = (int16_t)(-1 - (int16_t)(0xFFFFU - bits));
    }
    return value;
}

uint32_t fs_get_u32(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    uint32_t low = fs_get_u16(payload, length, offset);
    uint32_t high = fs_get_u16(payload, length, (uint16_t)(offset + 2U));

    return low | (high << 16);
}

int32_t fs_get_i32(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    uint32_t bits = fs_get_u32(payload, length, offset);
    int32_t value;

    if (bits < 0x80000000UL) {
        value = (int32_t)bits;
    } else {
        value = -1 - (int32_t)(0xFFFFFFFFUL - bits);
    }
    return value;
}

fs_uint64 fs_get_u64(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    fs_uint64 value;

    value.low = fs_get_u32(payload, length, offset);
    value.high = fs_get_u32(payload, length, (uint16_t)(offset + 4U));
    return value;
}

float fs_get_float(const fs_octet *payload, uint16_t length, uint16_t offset)
{
    return fs_bits_float(fs_get_u32(payload, length, offset));
}

void fs_get_octets(const fs_octet *payload, uint16_t length, uint16_t offset, fs_octet *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        values[i] = fs_get_octet(payload, length, (uint16_t)(offset + i));
    }
}

void fs_get_u32s(const fs_octet *payload, uint16_t length, uint16_t offset, uint32_t *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        values[i] = fs_get_u32(payload, length, (uint16_t)(offset + 4U * i));
    }
}

void fs_get_floats(const fs_octet *payload, uint16_t length, uint16_t offset, float *values, uint16_t count)
{
    uint16_t i;

    for (i = 0U; i < count; i++) {
        values[i] = fs_get_float(payload, length, (uint16_t)(offset + 4U * i));
    }
}

uint16_t fs_trimmed(const fs_octet *payload, uint16_t length)
{
    while ((length > 1U) && ((payload[length - 1U] & 0xFFU) == 0U)) {
        length--;
    }
    return length;
}

void fs_text_put(fs_octet *field, uint16_t room, const char *text)
{
    uint16_t i, used = 0U;

    while ((used < room) && (text[used] != '\0')) {
        field[used] = (fs_octet)((fs_octet)text[used] & 0xFFU);
        used++;
    }
    for (i = used; i < room; i++) {
        field[i] = 0U;
    }
}

void fs_text_get(const fs_octet *field, uint16_t room, char *out)
{
    uint16_t i;

    for (i = 0U; i < room; i++) {
        fs_octet octet = (fs_octet)(field[i] & 0xFFU);

        out[i] = (octet < 0x80U) ? (char)octet : '?';
    }
    out[room] = '\0';
}
