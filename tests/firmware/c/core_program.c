/* The core as a program, for a machine that cannot load it as a library: `core_program INPUT OUTPUT`.
 *
 * INPUT, in the machine's numbers: how many parameters, index and value of each as reals; how many steps, then all
 * states, setpoints, targets and flags. OUTPUT: all rows of core_driver.c, then each step's status.
 */
#include <stdio.h>
#include <stdlib.h>

#include "fs_loops.h"

#define STATE 13U
#define SETPOINT 11U
#define TARGET 5U
#define ROW 31U

void drive_init(fs_loops *loops);
uint32_t drive_set(fs_loops *loops, uint32_t index, fs_real value);
void drive_loops(fs_loops *loops, uint32_t count, const fs_vehicle_state *state, const fs_position_setpoint *setpoint,
                 const fs_attitude_target *target, const uint16_t *flags, fs_real *rows, uint16_t *status,
                 uint32_t *costs, uint32_t clock_at);

static FILE *input;

static void *take(size_t size, size_t count)
{
    void *const room = calloc(count + 1U, size);

    if (room == NULL || fread(room, size, count, input) != count) {
        exit(2);
    }
    return room;
}

int main(int argc, char **argv)
{
    static fs_loops loops;
    FILE *const output = argc == 3 ? fopen(argv[2], "wb") : NULL;

    input = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (input == NULL || output == NULL) {
        return 2;
    }
    drive_init(&loops);
    const uint32_t parameters = *(uint32_t *)take(sizeof(uint32_t), 1U);
    const fs_real *const values = take(sizeof(fs_real), 2U * parameters);
    for (uint32_t i = 0U; i < parameters; i++) {
        if (drive_set(&loops, (uint32_t)values[2U * i], values[2U * i + 1U]) != 0U) {
            return 3;
        }
    }
    const uint32_t count = *(uint32_t *)take(sizeof(uint32_t), 1U);
    const void *const states = take(sizeof(fs_real), STATE * count), *const setpoints =
        take(sizeof(fs_real), SETPOINT * count), *const targets = take(sizeof(fs_real), TARGET * count);
    const uint16_t *const flags = take(sizeof(uint16_t), count);
    fs_real *const rows = calloc(count, ROW * sizeof(fs_real));
    uint16_t *const status = calloc(count, sizeof(uint16_t));
    if (rows == NULL || status == NULL) {
        return 2;
    }
    drive_loops(&loops, count, states, setpoints, targets, flags, rows, status, NULL, 0U);
    fwrite(rows, sizeof(fs_real), (size_t)count * ROW, output);
    fwrite(status, sizeof(uint16_t), count, output);
    return fclose(output) == 0 ? 0 : 2;
}
