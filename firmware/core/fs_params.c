#include "fs_params.h"

#include "fs_controllers.h"
#include "fs_math.h"
#include "fs_param_table.h"

#define RADIANS_PER_DEGREE (FS_PI / FS_LIT(180.0))

uint16_t fs_param_count(void)
{
    return FS_PARAM_COUNT;
}

const char *fs_param_name(uint16_t index)
{
    return index < FS_PARAM_COUNT ? fs_param_spec_at(index)->name : "";
}

uint16_t fs_param_same_name(const char *a, const char *b)
{
    uint16_t i;

    for (i = 0U; i < FS_PARAM_NAME_SIZE; i++) {
        if (a[i] != b[i]) {
            return 0U;
        }
        if (a[i] == '\0') {
            return 1U;
        }
    }
    return 1U;
}

int16_t fs_param_find(const char *name16)
{
    uint16_t index;

    for (index = 0U; index < FS_PARAM_COUNT; index++) {
        if (fs_param_same_name(name16, fs_param_spec_at(index)->name)) {
            return (int16_t)index;
        }
    }
    return -1;
}

fs_real fs_param_get(const fs_loops *loops, uint16_t index)
{
    return fs_param_value(loops, index);
}

/* The integral that gives with the new gain what it gave with the old one; zero if none can. */
static fs_real carried_over(fs_real integral, fs_real old_gain, fs_real new_gain)
{
    const fs_real carried = new_gain != FS_LIT(0.0) ? integral * old_gain / new_gain : FS_LIT(0.0);

    return fs_is_finite(carried) ? carried : FS_LIT(0.0);
}

/* Take over the indices of the laws: a law must not begin with another flight's integrals. */
static void select_laws(fs_loops *loops)
{
    const fs_setup *setup = &loops->setup;
    fs_loop_rates *rates = &loops->rates;
    const uint16_t guidance = (uint16_t)setup->guidance, position = (uint16_t)setup->position;
    const uint16_t controller = (uint16_t)setup->controller, mixing = (uint16_t)setup->mixing;

    if (((guidance ^ rates->guidance) | (position ^ rates->position) | (controller ^ rates->controller) |
         (mixing ^ rates->mixing)) != 0U) {
        fs_loops_reset_laws(loops);
    }
    rates->guidance = guidance;
    rates->position = position;
    rates->controller = controller;
    rates->mixing = mixing;
}

/* Make what follows from the setup. */
static void derive(fs_loops *loops)
{
    const fs_setup *setup = &loops->setup;
    const fs_real outer_hz = setup->inner_hz / setup->outer_divisor;

    select_laws(loops);
    loops->rates.rotors = (uint16_t)setup->rotors;
    loops->rates.inner_dt_s = FS_LIT(1.0) / setup->inner_hz;
    loops->rates.outer_dt_s = FS_LIT(1.0) / outer_hz;
    loops->rates.fraction_step = outer_hz / setup->inner_hz;
    fs_position_laws_tilt(&loops->position, setup->max_tilt_deg * RADIANS_PER_DEGREE);
    fs_mixer_derive(&loops->mixer, loops->rates.rotors, &loops->resolution);
    loops->controller.pid.ix_kg_m2 = setup->ix_kg_m2;
    loops->controller.pid.iy_kg_m2 = setup->iy_kg_m2;
    loops->controller.pid.iz_kg_m2 = setup->iz_kg_m2;
    loops->controller.backstepping.ix_kg_m2 = setup->ix_kg_m2;
    loops->controller.backstepping.iy_kg_m2 = setup->iy_kg_m2;
    loops->controller.backstepping.iz_kg_m2 = setup->iz_kg_m2;
}

uint16_t fs_param_set(fs_loops *loops, uint16_t index, fs_real value)
{
    fs_real *place = fs_param_place(loops, index), *integral = fs_param_integral(loops, index);
    const fs_param_spec *spec;
    fs_real before;

    if (place == NULL) {
        return FS_PARAM_REFUSED;
    }
    spec = fs_param_spec_at(index);
    if (!(value >= spec->low && value <= spec->high)) { /* also when it is NaN */
        return FS_PARAM_REFUSED;
    }
    if (spec->is_whole && value != (fs_real)(uint16_t)value) {
        return FS_PARAM_REFUSED;
    }
    before = *place;
    *place = value; /* also 0 in place of -0, which are equal: a value reads back as it was set */
    if (!fs_param_is_consistent(loops)) {
        *place = before;
        return FS_PARAM_REFUSED;
    }
    if (integral != NULL && (value < before || value > before)) { /* x * gain / gain may differ from x */
        *integral = carried_over(*integral, before, value);
    }
    derive(loops);
    return FS_PARAM_DONE;
}

void fs_params_reset(fs_loops *loops)
{
    uint16_t index;

    for (index = 0U; index < FS_PARAM_COUNT; index++) {
        *fs_param_place(loops, index) = fs_param_spec_at(index)->initial;
    }
    derive(loops);
}
