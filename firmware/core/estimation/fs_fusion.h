/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Fusion of each sensor's measurements at the delayed horizon. flightstack/estimation/fusion.py */
#ifndef FS_FUSION_H
#define FS_FUSION_H

#include "fs_estimator_params.h"
#include "fs_kalman.h"
#include "fs_types.h"

/*
 * Fuse the magnetic field along an axis of the body.
 *
 * Its errors, of which soft iron makes most, change with the heading: it corrects the yaw, not the tilt. Nor does it
 * correct the gyro's biases about x and y, by which the tilt moves, while the velocity tells more of them.
 *
 * fusion.py:205
 */
void fs_fuse_field_axis(fs_filter *f, int32_t axis, const fs_vector3 *measured, const fs_estimator_params *params);

/*
 * Return the axis of a field to fuse as number at: of x and y, the one that tells more of the yaw comes first.
 *
 * A turn of a level body by delta changes x by delta y, and y by -delta x. While the yaw is unknown, an update by the
 * other one would turn it far beyond where its Jacobian holds, for a field that is only stronger or weaker than
 * expected.
 *
 * fusion.py:230
 */
int32_t fs_axis_by_yaw(const fs_vector3 *measured, int32_t at);

/* Fuse the magnetic field in the body frame, axis by axis, with an unknown yaw. fusion.py:242 */
void fs_fuse_field(fs_filter *f, const fs_vector3 *measured, const fs_estimator_params *params);

/* Fuse zero velocity along an axis of a vehicle that stands. fusion.py:274 */
void fs_fuse_rest_velocity(fs_filter *f, int32_t axis, const fs_estimator_params *params);

/*
 * Fuse zero rate about an axis of a vehicle that stands.
 *
 * rate_rad_s, with this variance of noise, is the bias of the gyro, and the motion of a vehicle that sways.
 *
 * fusion.py:284
 */
void fs_fuse_rest_rate(fs_filter *f, int32_t axis, const fs_vector3 *rate_rad_s, fs_real variance,
                       const fs_estimator_params *params);

/*
 * Fuse a horizontal position that is held without a measurement of it, which bounds velocity and tilt. fusion.py:301
 */
void fs_fuse_hold(fs_filter *f, int32_t axis, fs_real held_m, const fs_estimator_params *params);

/*
 * Fuse the specific force along the body's x (0) or y (1) axis, which in flight is the drag of the air.
 *
 * Drag is -(momentum_drag_1_s + 12 rho |u| / ballistic coefficient) u for the velocity u relative to the air: that of
 * the rotors' momentum and that of the body. Its change with |u| is left out of the Jacobian.
 *
 * fusion.py:249
 */
void fs_fuse_drag(fs_filter *f, int32_t axis, const fs_vector3 *force, const fs_estimator_params *params);

/*
 * Fuse a pressure altitude: minus the position down, plus the barometer's bias.
 *
 * It leaves horizontal position and velocity alone in dead reckoning: their errors are then so much larger than that
 * of the height that pressure in turns and gusts, which is not white noise, moves them by metres.
 *
 * fusion.py:172
 */
void fs_fuse_baro(fs_filter *f, fs_real altitude_m, fs_real age_s, const fs_estimator_params *params);

/* Return the cosine of the angle between the body's down axis and the vertical. fusion.py:187 */
fs_real fs_cos_tilt_of(const fs_filter *f);

/* Fuse the vertical part of a distance to level ground at ground_m below the origin. fusion.py:195 */
void fs_fuse_range(fs_filter *f, fs_real vertical_m, fs_real ground_m, fs_real age_s,
                   const fs_estimator_params *params);

/* Return the accuracy [m/s] of the velocity of a GNSS measurement. fusion.py:88 */
fs_real fs_speed_accuracy(const fs_real row[10]);

/* Return the accuracy [m] of the altitude of a GNSS measurement. fusion.py:82 */
fs_real fs_vertical_accuracy(const fs_real row[10]);

/* Return the accuracy [m] of the horizontal position of a GNSS measurement. fusion.py:76 */
fs_real fs_horizontal_accuracy(const fs_real row[10]);

/*
 * Return the share of the stated accuracy that is a slow error of one axis: eph covers two axes, epv one.
 * fusion.py:94
 */
fs_real fs_gnss_bias_share(const fs_estimator_params *params, int32_t axis);

/*
 * Propagate the Gauss-Markov process of the GNSS position bias.
 *
 * The height begins at the ground, so its bias is the error since the first fix. Its mean is not zero but minus the
 * error of that fix, which is not a state: it returns to zero so slowly that the barometer decides for half an hour.
 * Without a barometer it returns as fast as the others, for GNSS velocity alone drifts more.
 *
 * fusion.py:100
 */
void fs_drift_gnss_bias(fs_filter *f, const fs_real row[10], fs_real elapsed_s, const fs_estimator_params *params);

/* Fuse the velocity along an axis; with the fault VELOCITY_IS_WRONG it has more noise. fusion.py:134 */
void fs_fuse_gnss_velocity(fs_filter *f, const fs_real row[10], int32_t axis, fs_real fault,
                           const fs_estimator_params *params);

/*
 * Fuse the position along an axis, measured age_s before the time of the state; refuse one that drifts. fusion.py:147
 */
void fs_fuse_gnss_position(fs_filter *f, const fs_real row[10], fs_real age_s, int32_t axis, fs_real fault,
                           const fs_estimator_params *params);

#endif
