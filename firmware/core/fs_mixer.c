#include "fs_mixer.h"

#include "fs_math.h"

/*
 * Difference of demanded and achieved [N, N m] that tells a limit from rounding. Python's is the first number
 * alone, far above a double's rounding. With float the sums over the rotors round by more than that: about ten
 * operations on each term, the rounding of the numbers themselves among them, are counted as sixteen.
 */
#define FS_LAG_LEAST FS_LIT(1e-9)
#ifdef FS_DOUBLE
#define FS_LAG_SHARE 0.0
#else
#define FS_LAG_SHARE (16.0F * FS_ROUNDING)
#endif

static fs_real resolution_of(fs_real sum_of_magnitudes)
{
    return FS_LAG_LEAST + FS_LAG_SHARE * sum_of_magnitudes;
}

/* How far achieved lags behind demanded, zero within the resolution; the bit tells that it is not. */
static fs_real lag(fs_real demanded, fs_real achieved, fs_real resolution, uint16_t bit, uint16_t *bits)
{
    const fs_real behind = demanded - achieved;

    if (fs_abs(behind) <= resolution) {
        return FS_LIT(0.0);
    }
    *bits |= bit;
    return behind;
}

/* Largest k in [0, 1] for which low <= base + k direction <= high holds for every rotor. */
static fs_real largest_scale(const fs_real *base, const fs_real *direction, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real scale = FS_LIT(1.0);
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real step = direction[i];
        const fs_real room = step > FS_LIT(0.0) ? mixer->high[i] - base[i] : mixer->low[i] - base[i];
        if (scale * fs_abs(step) > fs_abs(room)) { /* never where the step is zero */
            scale = fs_max(FS_LIT(0.0), room / step);
        }
    }
    return scale;
}

/*
 * Scale the roll-pitch part so that some thrust brings it between the limits. Rotor i allows the thrusts from (low
 * - b)/a to (high - b)/a, a being its share of a newton: there is a common one when no rotor's least is above
 * another's most.
 */
static void fit_roll_pitch(fs_real *speed_squared, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real scale = FS_LIT(1.0);
    uint16_t i, j;

    for (i = 0U; i < rotors; i++) {
        const fs_real share_i = mixer->allocation[i][0];
        for (j = 0U; j < rotors; j++) {
            const fs_real share_j = mixer->allocation[j][0];
            const fs_real spread = speed_squared[i] * share_j - speed_squared[j] * share_i;
            const fs_real room = mixer->high[i] * share_j - mixer->low[j] * share_i;
            if (spread * scale > room) {
                scale = fs_max(FS_LIT(0.0), room / spread);
            }
        }
    }
    for (i = 0U; i < rotors; i++) {
        speed_squared[i] *= scale;
    }
}

/* The thrusts [N] that keep every rotor within its limits beside the roll-pitch part. */
typedef struct {
    fs_real least, most;
} fs_thrust_range;

static fs_thrust_range thrust_range(const fs_real *base, const fs_mixer *mixer, uint16_t rotors)
{
    fs_real least = -FS_REAL_MAX, most = FS_REAL_MAX;
    fs_thrust_range range;
    uint16_t i;

    for (i = 0U; i < rotors; i++) {
        const fs_real per_newton = mixer->allocation[i][0];
        if (per_newton > FS_LIT(0.0)) {
            least = fs_max(least, (mixer->low[i] - base[i]) / per_newton);
            most = fs_min(most, (mixer->high[i] - base[i]) / per_newton);
        }
    }
    range.least = least;
    range.most = most;
    return range;
}

static fs_real signed_root(fs_real square)
{
    const fs_real root = fs_sqrt(fs_abs(square));

    return square >= FS_LIT(0.0) ? root : -root;
}

/* Tell what squared speeds of these two parts make, and how far that falls short; return the status bits of that. */
static uint16_t judge(const fs_wrench *wrench, const fs_real *base, const fs_real *yaw, const fs_mixer *mixer,
                      uint16_t rotors, fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    const fs_real *effect = mixer->largest_effect;
    fs_real thrust = FS_LIT(0.0), roll = FS_LIT(0.0), pitch = FS_LIT(0.0), heading = FS_LIT(0.0), sum = FS_LIT(0.0);
    uint16_t bits = 0U, i;

    for (i = 0U; i < rotors; i++) {
        const fs_real square = base[i] + yaw[i];
        thrust += mixer->effectiveness[0][i] * square;
        roll += mixer->effectiveness[1][i] * square;
        pitch += mixer->effectiveness[2][i] * square;
        heading += mixer->effectiveness[3][i] * square;
        sum += fs_abs(base[i]) + fs_abs(yaw[i]);
    }
    achieved->thrust_n = thrust;
    achieved->torque_frd_n_m.x = roll;
    achieved->torque_frd_n_m.y = pitch;
    achieved->torque_frd_n_m.z = heading;
    saturation->thrust =
        lag(wrench->thrust_n, thrust, resolution_of(effect[0] * sum), FS_STATUS_THRUST_SATURATED, &bits);
    saturation->torque.x = lag(torque->x, roll, resolution_of(effect[1] * sum), FS_STATUS_ROLL_SATURATED, &bits);
    saturation->torque.y = lag(torque->y, pitch, resolution_of(effect[2] * sum), FS_STATUS_PITCH_SATURATED, &bits);
    saturation->torque.z = lag(torque->z, heading, resolution_of(effect[3] * sum), FS_STATUS_YAW_SATURATED, &bits);
    return bits;
}

/* Squared speeds of a rotor for roll and pitch, for yaw, and for roll, pitch and thrust. */
typedef struct {
    fs_real base, turn, lift;
} fs_part;

/* How a wrench is shared out, and what the limits leave of it. */
typedef struct {
    fs_part part[FS_MAX_ROTORS];
    fs_real tilt_scale; /* of roll and pitch, in [0, 1] */
    fs_real thrust_n;
    fs_real yaw_scale;          /* in [0, 1] */
    uint16_t is_free;           /* 1: no rotor comes near a limit, neither with yaw nor without */
    uint16_t is_thrust_limited; /* 1: some rotor is beyond a limit, or next to it, before there is any yaw */
} fs_shares;

/* Lower the scale of yaw to what a rotor has room for. */
static inline fs_real scale_within(fs_real scale, const fs_part *part, const fs_rotor *rotor)
{
    const fs_real room = part->turn > FS_LIT(0.0) ? rotor->high - part->lift : part->lift - rotor->low;
    const fs_real size = fs_abs(part->turn);

    return scale * size > room ? room / size : scale;
}

/* Share a wrench out to one rotor as if there were no limits, and note which there are. */
static inline void share_out_to(const fs_rotor *rotor, const fs_wrench *wrench, fs_part *part, fs_shares *shares)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    const fs_real base = rotor->share[1] * torque->x + rotor->share[2] * torque->y;
    const fs_real turn = rotor->share[3] * torque->z;
    const fs_real lift = base + rotor->share[0] * wrench->thrust_n, off = fs_abs(lift - rotor->middle);

    part->base = base;
    part->turn = turn;
    part->lift = lift;
    if (!(off + fs_abs(turn) <= rotor->reach)) {
        shares->is_free = 0U;
        if (!(off <= rotor->reach)) {
            shares->is_thrust_limited = 1U;
        }
    }
}

static void share_out(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_shares *shares)
{
    uint16_t i;

    shares->tilt_scale = FS_LIT(1.0);
    shares->thrust_n = wrench->thrust_n;
    shares->yaw_scale = FS_LIT(1.0);
    shares->is_free = 1U;
    shares->is_thrust_limited = 0U;
    share_out_to(&mixer->rotor[0], wrench, &shares->part[0], shares);
    share_out_to(&mixer->rotor[1], wrench, &shares->part[1], shares);
    share_out_to(&mixer->rotor[2], wrench, &shares->part[2], shares);
    share_out_to(&mixer->rotor[3], wrench, &shares->part[3], shares);
    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        share_out_to(&mixer->rotor[i], wrench, &shares->part[i], shares);
    }
}

/* Share out again to one rotor what the limits leave of roll, pitch and thrust. */
static inline void share_out_again(const fs_rotor *rotor, const fs_shares *shares, fs_part *part)
{
    const fs_real lift = part->base * shares->tilt_scale + rotor->share[0] * shares->thrust_n;

    part->lift = fs_min(fs_max(lift, rotor->low), rotor->high); /* beyond by no more than rounding */
}

/*
 * Limit roll and pitch, then thrust, for rotors that are alike: the one that roll and pitch ask most of and the one
 * that they ask least of decide for all.
 */
static void limit(const fs_mixer *mixer, uint16_t rotors, fs_shares *shares)
{
    const fs_rotor *alike = &mixer->rotor[0];
    const fs_part *part = shares->part;
    fs_real upper = fs_max(fs_max(fs_max(part[0].base, part[1].base), part[2].base), part[3].base);
    fs_real lower = fs_min(fs_min(fs_min(part[0].base, part[1].base), part[2].base), part[3].base);
    uint16_t i;

    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        upper = fs_max(upper, part[i].base);
        lower = fs_min(lower, part[i].base);
    }
    if (upper - lower > alike->high - alike->low) {
        shares->tilt_scale = (alike->high - alike->low) / (upper - lower);
        upper *= shares->tilt_scale;
        lower *= shares->tilt_scale;
    }
    shares->thrust_n = fs_max(fs_min(shares->thrust_n, (alike->high - upper) / alike->share[0]),
                              (alike->low - lower) / alike->share[0]);
    share_out_again(alike, shares, &shares->part[0]);
    share_out_again(alike, shares, &shares->part[1]);
    share_out_again(alike, shares, &shares->part[2]);
    share_out_again(alike, shares, &shares->part[3]);
    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        share_out_again(alike, shares, &shares->part[i]);
    }
}

/* Limit yaw to what the rest leaves. */
static void limit_yaw(const fs_mixer *mixer, uint16_t rotors, fs_shares *shares)
{
    const fs_rotor *rotor = mixer->rotor;
    const fs_part *part = shares->part;
    fs_real scale = scale_within(FS_LIT(1.0), &part[0], &rotor[0]);
    uint16_t i;

    scale = scale_within(scale, &part[1], &rotor[1]);
    scale = scale_within(scale, &part[2], &rotor[2]);
    scale = scale_within(scale, &part[3], &rotor[3]);
    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        scale = scale_within(scale, &part[i], &rotor[i]);
    }
    shares->yaw_scale = scale;
}

/* Whether no sum overflowed. */
static uint16_t is_finite(const fs_real *rotor_speed_rad_s, uint16_t rotors, const fs_wrench *achieved)
{
    const fs_vector3 *torque = &achieved->torque_frd_n_m;
    fs_real sum = fs_add_part(FS_LIT(0.0), achieved->thrust_n);
    uint16_t i;

    sum = fs_add_part(fs_add_part(fs_add_part(sum, torque->x), torque->y), torque->z);
    for (i = 0U; i < rotors; i++) {
        sum = fs_add_part(sum, rotor_speed_rad_s[i]);
    }
    return fs_is_finite(sum);
}

/* Mix where roll and pitch may have to be scaled, or effectiveness does not undo allocation. */
static uint16_t fit(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors, fs_real *rotor_speed_rad_s,
                    fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    fs_real base[FS_MAX_ROTORS], yaw[FS_MAX_ROTORS], thrust_n, scale;
    fs_thrust_range range;
    uint16_t bits, i;

    for (i = 0U; i < rotors; i++) {
        base[i] = mixer->allocation[i][1] * torque->x + mixer->allocation[i][2] * torque->y;
        yaw[i] = mixer->allocation[i][3] * torque->z;
    }
    fit_roll_pitch(base, mixer, rotors);
    range = thrust_range(base, mixer, rotors);
    thrust_n = fs_max(fs_min(wrench->thrust_n, range.most), range.least);
    for (i = 0U; i < rotors; i++) {
        base[i] = fs_min(fs_max(base[i] + mixer->allocation[i][0] * thrust_n, mixer->low[i]), mixer->high[i]);
    }
    scale = largest_scale(base, yaw, mixer, rotors);
    for (i = 0U; i < rotors; i++) {
        yaw[i] *= scale;
        rotor_speed_rad_s[i] = signed_root(base[i] + yaw[i]);
    }
    bits = judge(wrench, base, yaw, mixer, rotors, achieved, saturation);
    return is_finite(rotor_speed_rad_s, rotors, achieved) ? bits : FS_STATUS_OUTPUT_NOT_FINITE;
}

/* Write the speed of a rotor, with yaw scaled, and return it. */
static inline fs_real turn_rotor(const fs_part *part, fs_real scale, fs_real *speed_rad_s)
{
    *speed_rad_s = signed_root(part->lift + scale * part->turn);
    return *speed_rad_s;
}

/* Write the rotors' speeds, and return 0 if one of them is not finite, which only limits can make it. */
static uint16_t turn_rotors(const fs_shares *shares, uint16_t rotors, fs_real *rotor_speed_rad_s)
{
    const fs_real scale = shares->yaw_scale;
    fs_real sum = turn_rotor(&shares->part[0], scale, &rotor_speed_rad_s[0]);
    uint16_t i;

    sum += turn_rotor(&shares->part[1], scale, &rotor_speed_rad_s[1]);
    sum += turn_rotor(&shares->part[2], scale, &rotor_speed_rad_s[2]);
    sum += turn_rotor(&shares->part[3], scale, &rotor_speed_rad_s[3]);
    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        sum += turn_rotor(&shares->part[i], scale, &rotor_speed_rad_s[i]);
    }
    return fs_is_finite(sum);
}

/* What the rotors make of a wrench is known without multiplying it out, because effectiveness undoes allocation. */
static uint16_t judge_shares(const fs_wrench *wrench, const fs_mixer *mixer, const fs_shares *shares,
                             fs_wrench *achieved, fs_saturation *saturation)
{
    const fs_vector3 *torque = &wrench->torque_frd_n_m;
    const fs_real *resolution = mixer->resolution;
    uint16_t bits = 0U;

    *achieved = *wrench;
    achieved->thrust_n = shares->thrust_n;
    achieved->torque_frd_n_m.z = shares->yaw_scale * torque->z;
    saturation->thrust =
        lag(wrench->thrust_n, achieved->thrust_n, resolution[0], FS_STATUS_THRUST_SATURATED, &bits);
    saturation->torque.x = FS_LIT(0.0);
    saturation->torque.y = FS_LIT(0.0);
    saturation->torque.z = lag(torque->z, achieved->torque_frd_n_m.z, resolution[3], FS_STATUS_YAW_SATURATED, &bits);
    if (shares->tilt_scale < FS_LIT(1.0)) {
        const fs_real roll = shares->tilt_scale * torque->x, pitch = shares->tilt_scale * torque->y;
        achieved->torque_frd_n_m.x = roll;
        achieved->torque_frd_n_m.y = pitch;
        saturation->torque.x = lag(torque->x, roll, resolution[1], FS_STATUS_ROLL_SATURATED, &bits);
        saturation->torque.y = lag(torque->y, pitch, resolution[2], FS_STATUS_PITCH_SATURATED, &bits);
    }
    return bits;
}

uint16_t fs_mix(const fs_wrench *wrench, const fs_mixer *mixer, uint16_t rotors,
                fs_real rotor_speed_rad_s[FS_MAX_ROTORS], fs_wrench *achieved, fs_saturation *saturation)
{
    fs_shares shares;
    uint16_t i;

    for (i = FS_LEAST_ROTORS; i < FS_MAX_ROTORS; i++) {
        rotor_speed_rad_s[i] = FS_LIT(0.0);
    }
    if (mixer->is_inverse == 0U) {
        return fit(wrench, mixer, rotors, rotor_speed_rad_s, achieved, saturation);
    }
    share_out(wrench, mixer, rotors, &shares);
    if (shares.is_free == 0U) {
        if (shares.is_thrust_limited != 0U) {
            if (mixer->is_even == 0U) {
                return fit(wrench, mixer, rotors, rotor_speed_rad_s, achieved, saturation);
            }
            limit(mixer, rotors, &shares);
        }
        limit_yaw(mixer, rotors, &shares);
    }
    if (turn_rotors(&shares, rotors, rotor_speed_rad_s) == 0U) { /* a squared speed was beyond all numbers */
        return FS_STATUS_OUTPUT_NOT_FINITE;
    }
    if (shares.is_free == 0U) {
        return judge_shares(wrench, mixer, &shares, achieved, saturation);
    }
    *achieved = *wrench;
    saturation->thrust = FS_LIT(0.0);
    saturation->torque.x = FS_LIT(0.0);
    saturation->torque.y = FS_LIT(0.0);
    saturation->torque.z = FS_LIT(0.0);
    return 0U;
}

/* Share of the largest that a sum could be that its rounding may be; the numbers' own errors are in it. */
#ifdef FS_DOUBLE
#define FS_INVERSE_SHARE (1024.0 * FS_ROUNDING)
#else
#define FS_INVERSE_SHARE (16.0F * FS_ROUNDING)
#endif

/* Whether effectiveness times allocation is the identity but for rounding, and every rotor lifts. */
static uint16_t is_inverse(const fs_mixer *mixer, uint16_t rotors)
{
    uint16_t row, column, i;

    for (i = 0U; i < rotors; i++) {
        if (!(mixer->allocation[i][0] > FS_LIT(0.0))) {
            return 0U;
        }
    }
    for (row = 0U; row < 4U; row++) {
        for (column = 0U; column < 4U; column++) {
            fs_real sum = row == column ? FS_LIT(-1.0) : FS_LIT(0.0), magnitude = FS_LIT(0.0);
            for (i = 0U; i < rotors; i++) {
                sum += mixer->effectiveness[row][i] * mixer->allocation[i][column];
                magnitude += fs_abs(mixer->allocation[i][column]);
            }
            if (!(fs_abs(sum) <= FS_INVERSE_SHARE * mixer->largest_effect[row] * magnitude)) {
                return 0U;
            }
        }
    }
    return 1U;
}

/* Whether two numbers are the same but for rounding. */
static uint16_t is_same(fs_real a, fs_real b)
{
    return fs_abs(a - b) <= FS_LIT(16.0) * FS_ROUNDING * fs_abs(a) ? 1U : 0U;
}

/* Whether all rotors have the same limits and the same share of the thrust. */
static uint16_t is_even(const fs_mixer *mixer, uint16_t rotors)
{
    const fs_rotor *first = &mixer->rotor[0];
    uint16_t i;

    for (i = 1U; i < rotors; i++) {
        const fs_rotor *rotor = &mixer->rotor[i];
        if (!is_same(first->share[0], rotor->share[0]) || !is_same(first->low, rotor->low) ||
            !is_same(first->high, rotor->high)) {
            return 0U;
        }
    }
    return 1U;
}

void fs_mixer_derive(fs_mixer *mixer, uint16_t rotors)
{
    fs_real sum = FS_LIT(0.0);
    uint16_t axis, i;

    for (i = 0U; i < FS_MAX_ROTORS; i++) {
        const fs_real low = mixer->low[i], high = mixer->high[i];
        fs_rotor *rotor = &mixer->rotor[i];
        for (axis = 0U; axis < 4U; axis++) {
            rotor->share[axis] = mixer->allocation[i][axis];
        }
        rotor->low = low;
        rotor->high = high;
        rotor->middle = FS_LIT(0.5) * low + FS_LIT(0.5) * high;
        rotor->reach = (FS_LIT(0.5) * high - FS_LIT(0.5) * low) -
                       FS_LIT(8.0) * FS_ROUNDING * (fs_abs(low) + fs_abs(high));
        if (i < rotors) {
            sum += fs_max(fs_abs(low), fs_abs(high));
        }
    }
    for (axis = 0U; axis < 4U; axis++) {
        fs_real largest = FS_LIT(0.0);
        for (i = 0U; i < FS_MAX_ROTORS; i++) {
            largest = fs_max(largest, fs_abs(mixer->effectiveness[axis][i]));
        }
        mixer->largest_effect[axis] = largest;
        mixer->resolution[axis] = resolution_of(largest * sum);
    }
    mixer->is_inverse = is_inverse(mixer, rotors);
    mixer->is_even = is_even(mixer, rotors);
}

fs_real fs_relative_rotor_speed(const fs_real rotor_speed_rad_s[FS_MAX_ROTORS], const fs_mixer *mixer, uint16_t rotors)
{
    fs_real total = FS_LIT(0.0) - mixer->spin[0] * rotor_speed_rad_s[0];
    uint16_t i;

    total -= mixer->spin[1] * rotor_speed_rad_s[1];
    total -= mixer->spin[2] * rotor_speed_rad_s[2];
    total -= mixer->spin[3] * rotor_speed_rad_s[3];
    for (i = FS_LEAST_ROTORS; i < rotors; i++) {
        total -= mixer->spin[i] * rotor_speed_rad_s[i];
    }
    return total;
}
