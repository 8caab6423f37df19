/* Generated from Python by flightstack.firmware.generator: do not edit. */
/* Quaternions, Euler angles and vectors for compiled code. flightstack/core/geometry.py */
#ifndef FS_ESTIMATION_GEOMETRY_H
#define FS_ESTIMATION_GEOMETRY_H

#include "fs_types.h"

/* Quaternion of yaw, then pitch, then roll (3-2-1). geometry.py:123 */
fs_quaternion fs_quaternion_from_euler(fs_real roll_rad, fs_real pitch_rad, fs_real yaw_rad);

/* Wrap an angle to [-pi, pi). geometry.py:147 */
fs_real fs_wrap_pi(fs_real angle_rad);

#endif
