/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Initial state: tilt from the specific force, yaw from the magnetometer, biases zero; and resets to measurements.
 * flightstack/estimation/alignment.py
 */
#ifndef FS_ALIGNMENT_H
#define FS_ALIGNMENT_H

#include "fs_estimator_params.h"
#include "fs_kalman.h"
#include "fs_types.h"

/* Sums of the samples of a vehicle that stands. */
typedef struct {
    fs_real force[3];
    fs_real field[3];
    fs_real forces;
    fs_real fields;
    fs_real elapsed_s;
} fs_alignment;

/* Add a sample of the magnetic field. alignment.py:67 */
void fs_add_field(fs_alignment *sums, const fs_vector3 *field);

/* Add a sample of the specific force; return True if all are enough. alignment.py:55 */
bool fs_add_force(fs_alignment *sums, const fs_vector3 *force, fs_real dt_s);

/* Set the covariance to that of an aligned filter without correlations. alignment.py:84 */
void fs_set_initial_variances(fs_filter *f, const fs_estimator_params *params, fs_real speed_m_s, fs_real tilt_rad);

/* Return the attitude of a vehicle that stands, from its specific force. alignment.py:76 */
fs_quaternion fs_level_attitude(const fs_vector3 *force, fs_real yaw_rad);

/*
 * Set the states of the field: the Earth's field, or level, the measured one in level axes, turned to north.
 * alignment.py:163
 */
void fs_set_field(fs_filter *f, const fs_vector3 *level, const fs_vector3 *earth, fs_real declination_rad,
                  const fs_estimator_params *params);

/*
 * Turn the attitude to the yaw of the measured field, and set the states of the field; return the turn [rad].
 * alignment.py:141
 */
fs_real fs_turn_to_field(fs_filter *f, const fs_vector3 *field, const fs_vector3 *earth, fs_real declination_rad,
                         const fs_estimator_params *params);

/* Turn the attitude to the yaw of the measured field, and fuse the field; return the turn [rad]. alignment.py:131 */
fs_real fs_align_yaw(fs_filter *f, const fs_vector3 *field, const fs_vector3 *earth, fs_real declination_rad,
                     const fs_estimator_params *params);

/*
 * Set attitude, field and covariance from the sums of a vehicle that stands.
 *
 * earth is the Earth's field [gauss, NED] at the place; zero if unknown: then the measured field is taken, turned to
 * the declination, or to zero if that is NaN.
 *
 * alignment.py:100
 */
void fs_align(fs_filter *f, const fs_alignment *sums, const fs_vector3 *earth, fs_real declination_rad,
              const fs_estimator_params *params);

#endif
