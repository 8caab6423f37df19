/* Backstepping attitude control: flightstack/control/attitude_backstepping.py. */
#ifndef FS_ATTITUDE_BACKSTEPPING_H
#define FS_ATTITUDE_BACKSTEPPING_H

#include "fs_numbers.h"

/* Torque [N m, FRD]: the law of each axis, with coupling and gyroscopic torque cancelled. It has no memory. */
fs_vector3 fs_attitude_backstepping_step(const fs_vector3 *error_rad, const fs_vector3 *rates_frd_rad_s,
                                         const fs_attitude_reference *reference, fs_real relative_rotor_speed_rad_s,
                                         const fs_backstepping_params *params);

#endif
