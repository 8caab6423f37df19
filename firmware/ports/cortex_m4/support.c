/* Functions that a freestanding compiler may call implicitly: block operations, and a square root. */
#include <stddef.h>
#include <stdint.h>

/* words that may alias anything: structures are copied through them */
typedef uint32_t __attribute__((may_alias)) fs_word;

/* keeps a compiler from recognising the loop and replacing it by a call of the function it is in */
#define FS_KEEP_LOOP() __asm__ volatile("" : : : "memory")

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memmove(void *to, const void *from, size_t length);
void *memset(void *to, int value, size_t length);
int memcmp(const void *left, const void *right, size_t length);
size_t strlen(const char *text);
float sqrtf(float value);

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    unsigned char *target = to;
    const unsigned char *source = from;

    if ((((uintptr_t)to | (uintptr_t)from) & 3U) == 0U) {
        /* eight words at a time, as the C libraries for this processor do */
        for (; length >= 32U; length -= 32U) {
            __asm__ volatile("ldmia %1!, {r2-r5, r8-r10, r12}\n stmia %0!, {r2-r5, r8-r10, r12}"
                             : "+r"(target), "+r"(source)
                             :
                             : "r2", "r3", "r4", "r5", "r8", "r9", "r10", "r12", "memory");
        }
        for (; length >= 4U; length -= 4U, target += 4, source += 4) {
            *(fs_word *)(void *)target = *(const fs_word *)(const void *)source;
            FS_KEEP_LOOP();
        }
    }
    for (; length != 0U; length--) {
        *target++ = *source++;
        FS_KEEP_LOOP();
    }
    return to;
}

void *memmove(void *to, const void *from, size_t length)
{
    unsigned char *target = to;
    const unsigned char *source = from;

    if (target < source) {
        for (; length != 0U; length--) {
            *target++ = *source++;
            FS_KEEP_LOOP();
        }
        return to;
    }
    while (length != 0U) {
        length--;
        target[length] = source[length];
        FS_KEEP_LOOP();
    }
    return to;
}

void *memset(void *to, int value, size_t length)
{
    unsigned char *target = to;

    if (((uintptr_t)to & 3U) == 0U) {
        const uint32_t word = ((uint32_t)value & 0xFFU) * 0x01010101U;

        for (; length >= 4U; length -= 4U, target += 4) {
            *(fs_word *)(void *)target = word;
            FS_KEEP_LOOP();
        }
    }
    for (; length != 0U; length--) {
        *target++ = (unsigned char)value;
        FS_KEEP_LOOP();
    }
    return to;
}

int memcmp(const void *left, const void *right, size_t length)
{
    const unsigned char *a = left;
    const unsigned char *b = right;

    for (; length != 0U; length--, a++, b++) {
        if (*a != *b) {
            return (*a < *b) ? -1 : 1;
        }
    }
    return 0;
}

size_t strlen(const char *text)
{
    size_t length = 0U;

    while (text[length] != '\0') {
        length++;
        FS_KEEP_LOOP();
    }
    return length;
}

/* the names by which the ARM run-time ABI calls the same ("Run-time ABI for the Arm Architecture", 4.3.4) */
void __aeabi_memcpy(void *to, const void *from, size_t length);
void __aeabi_memcpy4(void *to, const void *from, size_t length);
void __aeabi_memcpy8(void *to, const void *from, size_t length);
void __aeabi_memset(void *to, size_t length, int value);
void __aeabi_memset4(void *to, size_t length, int value);
void __aeabi_memset8(void *to, size_t length, int value);
void __aeabi_memclr(void *to, size_t length);
void __aeabi_memclr4(void *to, size_t length);
void __aeabi_memclr8(void *to, size_t length);

void __aeabi_memcpy(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memcpy4(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memcpy8(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memset(void *to, size_t length, int value)
{
    (void)memset(to, value, length);
}

void __aeabi_memset4(void *to, size_t length, int value)
{
    (void)memset(to, value, length);
}

void __aeabi_memset8(void *to, size_t length, int value)
{
    (void)memset(to, value, length);
}

void __aeabi_memclr(void *to, size_t length)
{
    (void)memset(to, 0, length);
}

void __aeabi_memclr4(void *to, size_t length)
{
    (void)memset(to, 0, length);
}

void __aeabi_memclr8(void *to, size_t length)
{
    (void)memset(to, 0, length);
}

/* the instruction itself: correctly rounded, as IEEE 754 demands */
float sqrtf(float value)
{
    float root;

    __asm__("vsqrt.f32 %0, %1" : "=t"(root) : "t"(value));
    return root;
}
