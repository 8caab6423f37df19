/*
 * Numbers of this port: clock, baud rate, buffers, stack. What can be wrong about them stops the build here.
 *
 * Sources: TI's C2000Ware (device.h, sci.c, sysctl.h of driverlib/f2837xs) and the technical reference manual of the
 * TMS320F2837xS (SPRUHX5; of the F2837xD: SPRUHM8): SCI baud rate, FIFO interrupts, watchdog.
 */
#ifndef F28_BOARD_H
#define F28_BOARD_H

#include "fs_wire.h"

/* F28_BOARD is what FS_PIL_IDENTITY tells; the lights are LEDs by their GPIO, lit at 0. TI's device.h has the pins of SCIA. */
#ifdef _LAUNCHXL_F28379D
#define F28_LAUNCHPAD "LAUNCHXL-F28379D"
#define F28_LIGHT_HEARTBEAT 31UL
#define F28_LIGHT_HEARTBEAT_PIN GPIO_31_GPIO31
#define F28_LIGHT_SAFE 34UL
#define F28_LIGHT_SAFE_PIN GPIO_34_GPIO34
#else
#define F28_LAUNCHPAD "LAUNCHXL-F28377S"
#define F28_LIGHT_HEARTBEAT 12UL
#define F28_LIGHT_HEARTBEAT_PIN GPIO_12_GPIO12
#define F28_LIGHT_SAFE 13UL
#define F28_LIGHT_SAFE_PIN GPIO_13_GPIO13
#endif
#ifndef F28_BOARD
#define F28_BOARD F28_LAUNCHPAD /* a build for anything else overrides it */
#endif

#define F28_SYSCLK_HZ 200000000UL
#define F28_LSPCLK_HZ 200000000UL /* undivided: the finest steps of the baud rate */

#ifndef F28_BAUD
#define F28_BAUD 115200UL
#endif

/*
 * A bit of the SCI lasts a whole number of 8 LSPCLK periods, rounded down: the line runs a little too fast. Sender and
 * receiver may together be off by some 4 % (half a bit in ten); this side may take half of that.
 */
#define F28_SCI_EIGHTS (F28_LSPCLK_HZ / (8UL * F28_BAUD))
#define F28_SCI_REST (F28_LSPCLK_HZ - F28_SCI_EIGHTS * 8UL * F28_BAUD)

#if F28_BAUD < 1200UL
#error "F28_BAUD: below 1200 baud the pause between two octets passes for the end of a frame (FS_APP_SILENCE_MS)"
#elif F28_SCI_EIGHTS < 2UL || F28_SCI_EIGHTS > 65536UL
#error "F28_BAUD: the SCI's divisor has 16 bits and is 1 at least: 382 baud to 12.5 Mbaud"
#elif F28_SCI_REST > (F28_LSPCLK_HZ - F28_SCI_REST) / 50UL
#error "F28_BAUD: the SCI misses this rate by more than 2 %; it can make 115200, 460800, 921600, 1000000, 2500000"
#endif

#define F28_RECEIVE_RING 512U  /* octets, a power of two: four whole steps of PIL */
#define F28_SEND_RING 512U     /* octets, a power of two; the application holds back what does not fit */
#define F28_CHUNK 64U          /* octets that one pass of the main loop moves each way */

#ifndef F28_STACK_WORDS
#define F28_STACK_WORDS 0x600U /* 16-bit words; the linker's --stack_size has to be the same number */
#endif
#define F28_STACK_MARGIN 64U   /* words at its beginning that start-up code and main may use before it is painted */

#endif
