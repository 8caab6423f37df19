/* Generated from Python by flightstack.firmware.generator: do not edit. */
/*
 * Attitude reference: the filtered and differentiated attitude target that attitude controllers track.
 * flightstack/control/attitude_reference.py
 */
#ifndef FS_ATTITUDE_REFERENCE_H
#define FS_ATTITUDE_REFERENCE_H

#include "fs_numbers.h"
#include "fs_types.h"

/*
 * Advance the reference by dt_s towards target.
 *
 * The outer loop's target changes in steps, which would saturate the rotors of a stiff attitude loop. The filter
 * provides the rate and acceleration for feed-forward and backstepping (x_d', x_d''). It is a second-order system on
 * the rotation group: error by the quaternion logarithm, exact integration of the rotation over a step.
 *
 * attitude_reference.py:84
 */
void fs_attitude_reference_step(const fs_reference_memory *memory, const fs_quaternion *target,
                                const fs_reference_params *params, fs_real dt_s, fs_reference_memory *advanced_out,
                                fs_attitude_reference *attitude_reference_out);

/*
 * Rotate the reference's rates and acceleration from its own body frame to the vehicle's. attitude_reference.py:111
 */
fs_attitude_reference fs_in_body_frame(const fs_attitude_reference *reference, const fs_quaternion *attitude);

#endif
