/*
 * What the portable firmware must not mention. Included before everything else (gcc -include); the headers that define the
 * words come first, because nobody may say them afterwards.
 */
#ifndef POISON_H
#define POISON_H

#pragma GCC system_header /* no word about macros among what is poisoned */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* There are none on a C28x, whose smallest integer has 16 bits, or no two targets agree on their size. */
#pragma GCC poison int8_t uint8_t int_least8_t uint_least8_t int_fast8_t uint_fast8_t int_fast16_t uint_fast16_t
#pragma GCC poison int64_t uint64_t intptr_t uintptr_t intmax_t uintmax_t ptrdiff_t wchar_t
#pragma GCC poison short int long signed unsigned

/* double has 32 bits on an AVR and 64 elsewhere; what a target has no instruction for costs hundreds. */
#pragma GCC poison double

/* Octets do not lie in memory as on the wire. The one place that may copy says so. */
#ifndef POISON_ALLOWS_MEMCPY
#pragma GCC poison memcpy size_t sizeof
#endif
#pragma GCC poison memmove memset memcmp memchr strlen strcpy strncpy strcat strncat strcmp strncmp
#ifndef POISON_ALLOWS_UNION /* a view of one record, whose members have 32 bits on every target, as words */
#pragma GCC poison union
#endif
#pragma GCC poison offsetof

/* No heap, nothing printed, no way out but through the end. */
#pragma GCC poison malloc calloc realloc free alloca
#pragma GCC poison printf sprintf snprintf fprintf puts putchar sscanf
#pragma GCC poison setjmp longjmp goto abort exit assert errno

/* A C library's functions differ from one to the next in the last bit: fs_math.h has our own. */
#pragma GCC poison sin cos tan asin acos atan atan2 exp log pow sqrt hypot fabs floor ceil round fmod fmin fmax fma
#pragma GCC poison sinf cosf tanf asinf acosf atanf atan2f expf logf powf sqrtf hypotf fabsf floorf ceilf roundf fmodf
#pragma GCC poison fminf fmaxf fmaf isnan isinf isfinite signbit copysign copysignf NAN INFINITY
#pragma GCC poison rand srand atoi atof strtol strtod

#endif
