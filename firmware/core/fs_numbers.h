/* Generated from Python by flightstack.firmware.generator: do not edit. */
#ifndef FS_NUMBERS_H
#define FS_NUMBERS_H

#include "fs_types.h"

#define FS_PARAM_COUNT 131U

#define FS_GUIDANCE_LAW_DIRECT 0U
#define FS_GUIDANCE_LAWS 1U

#define FS_POSITION_LAW_PID 0U
#define FS_POSITION_LAWS 1U

#define FS_CONTROLLER_PID 0U
#define FS_CONTROLLER_BACKSTEPPING 1U
#define FS_CONTROLLERS 2U

#define FS_MIXER_LAW_ALLOCATION 0U
#define FS_MIXER_LAWS 1U

/* State of the filter: attitude and body rates of the reference. */
typedef struct {
    fs_real w;
    fs_real x;
    fs_real y;
    fs_real z;
    fs_real p_rad_s;
    fs_real q_rad_s;
    fs_real r_rad_s;
} fs_reference_memory;

/* Second-order filter: natural frequency (0: no filter), damping ratio and limits. */
typedef struct {
    fs_real bandwidth_rad_s;
    fs_real damping;
    fs_real max_rate_rad_s;
    fs_real max_acceleration_rad_s2;
} fs_reference_params;

/* Placeholder: a law without state; a memory type needs at least one field. */
typedef struct {
    fs_real unused;
} fs_no_memory;

/* Placeholder: a law without parameters; a type of parameters needs at least one field. */
typedef struct {
    fs_real unused;
} fs_no_params;

/* Integral of the position error, as acceleration [m/s^2], NED. */
typedef struct {
    fs_real x;
    fs_real y;
    fs_real z;
} fs_position_memory;

/* Gains in acceleration per error (1/s^2, 1/s^3, 1/s) and limits. */
typedef struct {
    fs_real kp_xy;
    fs_real ki_xy;
    fs_real kd_xy;
    fs_real kp_z;
    fs_real ki_z;
    fs_real kd_z;
    fs_real mass_kg;
    fs_real gravity_m_s2;
    fs_real min_thrust_n;
    fs_real max_thrust_n;
    fs_real max_tilt_rad;
    fs_real max_integral_m_s2;
} fs_position_params;

/* Integral of the attitude error [rad s]. */
typedef struct {
    fs_real roll;
    fs_real pitch;
    fs_real yaw;
} fs_pid_memory;

/* Gains in angular acceleration per error, independent of the vehicle; its inertia converts them to torque. */
typedef struct {
    fs_real kp_roll;
    fs_real kp_pitch;
    fs_real kp_yaw;
    fs_real ki_roll;
    fs_real ki_pitch;
    fs_real ki_yaw;
    fs_real kd_roll;
    fs_real kd_pitch;
    fs_real kd_yaw;
    fs_real rate_feedforward;
    fs_real acceleration_feedforward;
    fs_real ix_kg_m2;
    fs_real iy_kg_m2;
    fs_real iz_kg_m2;
} fs_pid_params;

/* Placeholder: the law has no state, and a memory type needs at least one field. */
typedef struct {
    fs_real unused;
} fs_backstepping_memory;

/* c1 to c6 [1/s] of the paper's Table III, feed-forward of x_d' and x_d'' (0 to 1), and inertias. */
typedef struct {
    fs_real c1;
    fs_real c2;
    fs_real c3;
    fs_real c4;
    fs_real c5;
    fs_real c6;
    fs_real rate_feedforward;
    fs_real acceleration_feedforward;
    fs_real ix_kg_m2;
    fs_real iy_kg_m2;
    fs_real iz_kg_m2;
    fs_real rotor_inertia_kg_m2;
} fs_backstepping_params;

/* Params of every law of guidance. */
typedef struct {
    fs_no_params direct;
} fs_guidance_law_params;

/* Memory of every law of guidance. */
typedef struct {
    fs_no_memory direct;
} fs_guidance_law_memory;

/* Params of every law of position. */
typedef struct {
    fs_position_params pid;
} fs_position_law_params;

/* Memory of every law of position. */
typedef struct {
    fs_position_memory pid;
} fs_position_law_memory;

/* Params of every law of attitude. */
typedef struct {
    fs_pid_params pid;
    fs_backstepping_params backstepping;
} fs_controller_params;

/* Memory of every law of attitude. */
typedef struct {
    fs_pid_memory pid;
    fs_backstepping_memory backstepping;
} fs_controller_memory;

/* Params of every law of mixer. */
typedef struct {
    fs_no_params allocation;
} fs_mixer_law_params;

/* Memory of every law of mixer. */
typedef struct {
    fs_no_memory allocation;
} fs_mixer_law_memory;

/* What several structures are made of, as it was set. */
typedef struct {
    fs_real guidance; /* indices of the laws */
    fs_real position;
    fs_real controller; /* of the attitude law: one of FS_CONTROLLER_* */
    fs_real mixing;
    fs_real rotors; /* 4 to FS_MAX_ROTORS */
    fs_real inner_hz; /* rate of the inner loop */
    fs_real outer_divisor; /* the outer loop runs in every so many inner ticks */
    fs_real max_tilt_deg; /* MPC_TILTMAX_AIR */
    fs_real ix_kg_m2; /* inertias, which every built-in attitude law has a copy of */
    fs_real iy_kg_m2;
    fs_real iz_kg_m2;
} fs_setup;

#endif
