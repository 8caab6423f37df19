#include "f28_lights.h"

#include "driverlib.h"
#include "device.h"

#include "f28_board.h"
#include "fs_app.h"

#define LIT 0U
#define DARK 1U

static void init_light(uint32_t pin, uint32_t configuration)
{
    GPIO_setPinConfig(configuration);
    GPIO_writePin(pin, DARK);
    GPIO_setPadConfig(pin, GPIO_PIN_TYPE_STD);
    GPIO_setDirectionMode(pin, GPIO_DIR_MODE_OUT);
}

void f28_lights_init(void)
{
    init_light(F28_LIGHT_HEARTBEAT, F28_LIGHT_HEARTBEAT_PIN);
    init_light(F28_LIGHT_SAFE, F28_LIGHT_SAFE_PIN);
}

void f28_lights_show(uint32_t now_ms, uint16_t state)
{
    uint32_t safe = DARK;

    if (state == FS_APP_SAFE) {
        safe = LIT;
    } else if (state == FS_APP_RESTARTED && (now_ms & 0x80UL) != 0UL) {
        safe = LIT;
    } else {
        /* dark */
    }
    GPIO_writePin(F28_LIGHT_HEARTBEAT, ((now_ms & 0x200UL) != 0UL) ? LIT : DARK);
    GPIO_writePin(F28_LIGHT_SAFE, safe);
}
