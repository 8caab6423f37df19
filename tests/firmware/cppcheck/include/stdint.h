/*
 * The C28x's integers. cppcheck's own library says that a uint16_t has two chars, which would make it 32 bits here; these
 * definitions come first. There is no uint8_t on purpose.
 */
#ifndef TESTS_STDINT_H
#define TESTS_STDINT_H

typedef int int16_t;
typedef unsigned int uint16_t;
typedef long int32_t;
typedef unsigned long uint32_t;

#endif
