/* The estimator without an application, for comparing processors: events of a flight go in, hashes come out.
 *
 * An event is an octet with its kind (a ring, or one of FILTER_*), one with the number of floats, and the floats.
 */
#ifndef FILTER_STEPS_H
#define FILTER_STEPS_H

#include "fs_estimator.h"

#define FILTER_IMU 10U
#define FILTER_FIELD 11U
#define FILTER_LANDING 12U
#define FILTER_EARTH 13U
#define FILTER_PARAMS 14U
#define FILTER_HEALTH 15U
#define FILTER_NUMBERS 16U /* calls of functions with numbers that the filter does not give them */
#define FILTER_ORIGIN 17U
#define FILTER_ROOM 64U
#define FILTER_PARTS 16U

typedef uint32_t (*filter_clock)(void);

typedef struct {
    fs_estimator_memory memory;
    fs_real row[FILTER_ROOM];
    union {
        fs_health_summary fields;
        fs_real values[sizeof(fs_health_summary) / sizeof(fs_real)];
    } summary;
    unsigned char octets[4];
    uint16_t place; /* octets of the event so far */
    uint16_t kind;
    uint16_t size;
    uint32_t hash;    /* FNV-1a over the output after every event */
    uint32_t samples; /* of the IMU */
    uint32_t sum;     /* of the costs of all samples of the IMU, in instructions */
    uint32_t most;
    uint32_t least; /* of a sample after the alignment: the output alone */
    filter_clock clock;
} filter_steps;

void filter_steps_init(filter_steps *s, filter_clock clock);
uint16_t filter_steps_push(filter_steps *s, uint16_t octet); /* 1 when the octet completed an event */
uint32_t filter_steps_hash(const filter_steps *s);           /* of the output, the state and the whole covariance */

/* Costs of the filter's parts, each called once more on the memory at the end. */
void filter_steps_costs(filter_steps *s, uint32_t costs[FILTER_PARTS]);

#endif
