/* Generated from Python by flightstack.firmware.generator: do not edit. */
#ifndef FS_TYPES_H
#define FS_TYPES_H

#include "fs_real.h"

#define FS_MAX_ROTORS 8U

/* bits of the status */
#define FS_STATUS_INPUT_NOT_FINITE 1U
#define FS_STATUS_ROLL_SATURATED 2U
#define FS_STATUS_PITCH_SATURATED 4U
#define FS_STATUS_YAW_SATURATED 8U
#define FS_STATUS_THRUST_SATURATED 16U
#define FS_STATUS_IDLE 32U
#define FS_STATUS_OUTPUT_NOT_FINITE 64U
#define FS_STATUS_INPUT_STALE 128U

/* World frame NED, body frame FRD, quaternions Hamilton, scalar first, body to world. SI units. */
/* A vector; the name of the variable states frame and unit. */
typedef struct {
    fs_real x;
    fs_real y;
    fs_real z;
} fs_vector3;

/* A unit quaternion, Hamilton convention, body FRD to world NED. */
typedef struct {
    fs_real w;
    fs_real x;
    fs_real y;
    fs_real z;
} fs_quaternion;

/* Rigid-body state of the vehicle at one instant. */
typedef struct {
    fs_vector3 position_ned_m;
    fs_vector3 velocity_ned_m_s;
    fs_quaternion attitude;
    fs_vector3 rates_frd_rad_s;
} fs_vehicle_state;

/* Input of the outer loop: a point of a trajectory and the heading. */
typedef struct {
    fs_vector3 position_ned_m;
    fs_vector3 velocity_ned_m_s;
    fs_vector3 acceleration_ned_m_s2;
    fs_real yaw_rad;
    fs_real yaw_rate_rad_s;
} fs_position_setpoint;

/* Output of the outer loop and input of the inner loop: attitude and collective thrust. */
typedef struct {
    fs_quaternion attitude;
    fs_real thrust_n;
} fs_attitude_target;

/* The attitude target after the reference filter, with its derivatives in the body frame. */
typedef struct {
    fs_quaternion attitude;
    fs_vector3 rates_frd_rad_s;
    fs_vector3 acceleration_frd_rad_s2;
} fs_attitude_reference;

/* Collective thrust along -z of the body and torque about the body axes. */
typedef struct {
    fs_real thrust_n;
    fs_vector3 torque_frd_n_m;
} fs_wrench;

/* Inputs of an attitude controller in one tick. */
typedef struct {
    fs_quaternion attitude;
    fs_vector3 rates_frd_rad_s;
    fs_attitude_reference reference;
    fs_vector3 error_rad;
    fs_real relative_rotor_speed_rad_s;
    fs_vector3 saturation;
} fs_attitude_inputs;

#endif
