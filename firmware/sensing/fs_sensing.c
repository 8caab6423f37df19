#include "fs_sensing.h"

#include "fs_app.h"
#include "fs_estimator.h"

#define ROW 10U
#define RESETS 19U /* numbers of fs_resets that the message has room for */
#define STATE 13U
#define EARTH 4U
#define KNOWN 4U      /* place of the flag behind the Earth's field */
#define VALUES_AT 2U  /* of parameters, behind the first index and their number */
#define MOST_VALUES 8U /* in an event: all behind VALUES_AT */
#define WORDS 60U
#define HALF FS_LIT(0.5)
#define LONGEST_MOVE FS_LIT(1.0e9) /* s, of the origin of the clock */

typedef union {
    fs_estimator_params fields;
    fs_real values[sizeof(fs_estimator_params) / sizeof(fs_real)];
} params_view;

typedef union {
    fs_flags fields;
    int32_t values[sizeof(fs_flags) / sizeof(int32_t)];
} flags_view;

typedef union {
    fs_resets fields;
    fs_real values[RESETS];
} resets_view;

/* The members of the memory are floats and integers of 32 bits, so that it can be read and cleared as words. */
typedef union {
    fs_estimator_memory estimator;
    uint32_t words[sizeof(fs_estimator_memory) / sizeof(uint32_t)];
} memory_view;

static memory_view whole;
static fs_estimator_memory *const memory = &whole.estimator;

static uint32_t word_count(void)
{
    return (uint32_t)(sizeof whole.words / sizeof whole.words[0]);
}

static void clear(void)
{
    uint32_t i;

    for (i = 0U; i < word_count(); i++) {
        whole.words[i] = 0UL; /* zero of floats and integers alike */
    }
    memory->params = fs_default_estimator_params;
}

static uint16_t set_params(const fs_pil_sense *event)
{
    params_view view;
    const uint16_t size = (uint16_t)(sizeof view.values / sizeof view.values[0]);
    uint16_t i, first, count;

    if (!((event->values[0] >= 0.0F) && (event->values[0] < (float)size) && (event->values[1] >= 0.0F) &&
          (event->values[1] <= (float)MOST_VALUES))) {
        return 0U;
    }
    first = (uint16_t)event->values[0];
    count = (uint16_t)event->values[1];
    if ((uint16_t)(first + count) > size) {
        return 0U;
    }
    view.fields = memory->params;
    for (i = 0U; i < count; i++) {
        view.values[first + i] = (fs_real)event->values[VALUES_AT + i];
    }
    memory->params = view.fields;
    return 1U;
}

static void set_earth(const fs_pil_sense *event)
{
    uint16_t i;

    for (i = 0U; i < EARTH; i++) {
        memory->earth[i] = (fs_real)event->values[i];
    }
    if (event->values[KNOWN] > 0.0F) {
        fs_field_kernel(memory);
    }
}

static void tell(fs_pil_estimate *estimate)
{
    resets_view resets;
    uint16_t i;

    for (i = 0U; i < STATE; i++) {
        estimate->state[i] = (float)memory->state[i];
    }
    resets.fields = memory->resets;
    for (i = 0U; i < RESETS; i++) {
        estimate->resets[i] = (float)resets.values[i];
    }
}

/* Flags of the memory in their order, the first one in bit 0. */
static uint32_t flags(void)
{
    flags_view view;
    uint32_t bits = 0UL;
    uint16_t i;

    view.fields = memory->flags;
    for (i = 0U; i < (uint16_t)(sizeof view.values / sizeof view.values[0]); i++) {
        bits |= (uint32_t)((view.values[i] != 0) ? 1UL : 0UL) << i;
    }
    return bits;
}

/* Number of values of a measurement; 0 for another kind of event. */
static int32_t size_of(uint32_t kind)
{
    int32_t size;

    switch (kind) {
    case (uint32_t)FS_GNSS_RING:
        size = 10;
        break;
    case (uint32_t)FS_MAG_RING:
        size = 4;
        break;
    case (uint32_t)FS_BARO_RING:
    case (uint32_t)FS_RANGE_RING:
        size = 2;
        break;
    default:
        size = 0;
        break;
    }
    return size;
}

/* Move the origin of the clock by a time that is not negative; tell whether it is one. */
static uint16_t move_clock(fs_real by_s)
{
    uint16_t is_valid = 0U;

    if ((by_s >= FS_LIT(0.0)) && (by_s <= LONGEST_MOVE)) {
        fs_move_clock_kernel(memory, by_s);
        is_valid = 1U;
    }
    return is_valid;
}

uint16_t fs_sensing_take(const fs_pil_sense *event, fs_pil_estimate *estimate)
{
    fs_real row[ROW];
    uint16_t i, is_valid = 1U;

    for (i = 0U; i < ROW; i++) {
        row[i] = (fs_real)event->values[i];
    }
    switch (event->kind) {
    case FS_SENSE_IMU:
        fs_imu_kernel(memory, row);
        tell(estimate);
        break;
    case FS_SENSE_EARTH:
        set_earth(event);
        tell(estimate);
        break;
    case FS_SENSE_LANDED:
        if (row[0] > HALF) {
            memory->flags.landed = 1;
        } else {
            memory->flags.landed = 0;
        }
        break;
    case FS_SENSE_PARAMS:
        is_valid = set_params(event);
        break;
    case FS_SENSE_ORIGIN:
        is_valid = move_clock(row[0]);
        break;
    case FS_SENSE_CLEAR:
        clear();
        break;
    case FS_SENSE_START:
        fs_start_memory(memory);
        break;
    default:
        if (size_of(event->kind) > 0) {
            fs_push_kernel(memory, (int32_t)event->kind, row, size_of(event->kind));
        } else {
            is_valid = 0U;
        }
        break;
    }
    estimate->flags = flags();
    return is_valid;
}

void fs_sensing_read(fs_pil_memory *words)
{
    uint32_t i;

    for (i = 0U; i < WORDS; i++) {
        words->words[i] = ((words->first + i) < word_count()) ? whole.words[words->first + i] : 0UL;
    }
}
