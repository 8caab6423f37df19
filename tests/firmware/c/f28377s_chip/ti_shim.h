/*
 * What a host's compiler lacks to read TI's own headers as cl2000 does: its keywords and intrinsics. Included before
 * everything else where C2000Ware is used. TI_REGISTERS leads driverlib's accesses to the simulated chip.
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

#ifdef TI_REGISTERS
#pragma GCC system_header /* no warnings for what driverlib does with the registers */
#define HW_TYPES_H /* takes the place of hw_types.h */
volatile uint16_t *fake_at16(uint32_t address);
volatile uint32_t *fake_at32(uint32_t address);
void fake_wait(void);
uint32_t *fake_gpio_control(void);
uint32_t *fake_gpio_data(void);
#define HWREGH(address) (*fake_at16((uint32_t)(address)))
#define HWREG(address) (*fake_at32((uint32_t)(address)))
#define HWREG_BP(address) HWREG(address)
typedef float float32_t;
typedef double float64_t;
#define TRUE 1
#define FALSE 0
#define asm(text) fake_wait() /* SYSCTL_REGWRITE_DELAY */
#define ESTOP0 __builtin_trap()
#include "inc/hw_memmap.h"
#undef GPIOCTRL_BASE /* driverlib reaches these two through pointers */
#undef GPIODATA_BASE
#define GPIOCTRL_BASE ((uintptr_t)fake_gpio_control())
#define GPIODATA_BASE ((uintptr_t)fake_gpio_data())
#endif

#endif
