/*
 * What a host's compiler lacks to read TI's own headers as cl2000 does: its keywords and intrinsics. Included before
 * everything else in the test that checks the port against C2000Ware; not used with the fake.
 */
#ifndef C28X_SHIM_H
#define C28X_SHIM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define __TMS320C28XX__ 1
#define __interrupt
#define __cregister
#define uint8_t c28x_uint8 /* driverlib defines these two itself, of 16 bits */
#define int8_t c28x_int8
#define CAN_H /* passes over can.h, which assigns to intrinsics */

uint16_t __enable_interrupts(void);
uint16_t __disable_interrupts(void);

#endif
