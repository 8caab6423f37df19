/* Stands in for the board's device.h with _LAUNCHXL_F28377S: names and values alone, written for the tests. */
#ifndef OWN_DEVICE_H
#define OWN_DEVICE_H

#include "driverlib.h"

#define DEVICE_GPIO_PIN_SCIRXDA 85U
#define DEVICE_GPIO_PIN_SCITXDA 84U
#define DEVICE_GPIO_CFG_SCIRXDA GPIO_85_SCIRXDA
#define DEVICE_GPIO_CFG_SCITXDA GPIO_84_SCITXDA
#define DEVICE_OSCSRC_FREQ 10000000U
#define DEVICE_SYSCLK_FREQ ((DEVICE_OSCSRC_FREQ * 40 * 1) / 2)

void Device_init(void);
void Device_initGPIO(void);

#endif
