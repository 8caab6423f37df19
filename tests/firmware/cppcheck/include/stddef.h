/* The C28x's size_t, for cppcheck. */
#ifndef TESTS_STDDEF_H
#define TESTS_STDDEF_H

typedef unsigned long size_t;
#define NULL ((void *)0)

#endif
