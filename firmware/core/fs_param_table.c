/* Generated from Python by flightstack.firmware.generator: do not edit. */
#include "fs_param_table.h"

static const fs_param_spec specs[FS_PARAM_COUNT] = {
    {"POS_XY_P", FS_LIT(0.0), FS_LIT(1000.0), FS_LIT(8.75), 0U},
    {"POS_XY_I", FS_LIT(0.0), FS_LIT(1000.0), FS_LIT(3.125), 0U},
    {"POS_XY_D", FS_LIT(0.0), FS_LIT(1000.0), FS_LIT(5.5), 0U},
    {"POS_Z_P", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(12.0), 0U},
    {"POS_Z_I", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(4.5), 0U},
    {"POS_Z_D", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(6.5), 0U},
    {"POS_I_MAX", FS_LIT(0.0), FS_LIT(20.0), FS_LIT(4.0), 0U},
    {"POS_THR_MAX", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(10.25145), 0U},
    {"POS_THR_MIN", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(0.43164), 0U},
    {"ATT_REF_BW", FS_LIT(0.0), FS_LIT(1000.0), FS_LIT(60.0), 0U},
    {"ATT_REF_DAMP", FS_LIT(0.1), FS_LIT(5.0), FS_LIT(1.0), 0U},
    {"ATT_REF_RATE", FS_LIT(0.1), FS_LIT(100.0), FS_LIT(8.0), 0U},
    {"ATT_REF_ACC", FS_LIT(0.1), FS_LIT(100000.0), FS_LIT(150.0), 0U},
    {"PID_ROLL_P", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(225.0), 0U},
    {"PID_PITCH_P", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(225.0), 0U},
    {"PID_YAW_P", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(25.0), 0U},
    {"PID_ROLL_I", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(200.0), 0U},
    {"PID_PITCH_I", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(200.0), 0U},
    {"PID_YAW_I", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(15.0), 0U},
    {"PID_ROLL_D", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(27.0), 0U},
    {"PID_PITCH_D", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(27.0), 0U},
    {"PID_YAW_D", FS_LIT(0.0), FS_LIT(1000000.0), FS_LIT(10.0), 0U},
    {"PID_RATE_FF", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"PID_ACC_FF", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"BS_ROLL_C1", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(14.0), 0U},
    {"BS_ROLL_C2", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(16.0), 0U},
    {"BS_PITCH_C3", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(14.0), 0U},
    {"BS_PITCH_C4", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(16.0), 0U},
    {"BS_YAW_C5", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(4.0), 0U},
    {"BS_YAW_C6", FS_LIT(0.0), FS_LIT(10000.0), FS_LIT(6.0), 0U},
    {"BS_RATE_FF", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"BS_ACC_FF", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"MPC_TILTMAX_AIR", FS_LIT(5.0), FS_LIT(70.0), FS_LIT(45.0), 0U},
    {"FS_CTRL", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(0.0), 1U},
    {"FS_ROTORS", FS_LIT(4.0), FS_LIT(8.0), FS_LIT(4.0), 1U},
    {"FS_INNER_HZ", FS_LIT(1.0), FS_LIT(20000.0), FS_LIT(500.0), 0U},
    {"FS_OUTER_DIV", FS_LIT(1.0), FS_LIT(20000.0), FS_LIT(5.0), 1U},
    {"FS_MASS", FS_LIT(0.001), FS_LIT(1000.0), FS_LIT(0.55), 0U},
    {"FS_GRAVITY", FS_LIT(0.1), FS_LIT(30.0), FS_LIT(9.81), 0U},
    {"FS_IX", FS_LIT(1e-08), FS_LIT(10000.0), FS_LIT(0.0072), 0U},
    {"FS_IY", FS_LIT(1e-08), FS_LIT(10000.0), FS_LIT(0.0072), 0U},
    {"FS_IZ", FS_LIT(1e-08), FS_LIT(10000.0), FS_LIT(0.011), 0U},
    {"FS_JR", FS_LIT(0.0), FS_LIT(1.0), FS_LIT(6.3e-05), 0U},
    {"FS_ALLOC_00", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(8532.42320819), 0U},
    {"FS_ALLOC_01", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_02", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(85324.2320819), 0U},
    {"FS_ALLOC_03", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(-347222.222222), 0U},
    {"FS_ALLOC_10", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(8532.42320819), 0U},
    {"FS_ALLOC_11", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(-85324.2320819), 0U},
    {"FS_ALLOC_12", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_13", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(347222.222222), 0U},
    {"FS_ALLOC_20", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(8532.42320819), 0U},
    {"FS_ALLOC_21", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_22", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(-85324.2320819), 0U},
    {"FS_ALLOC_23", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(-347222.222222), 0U},
    {"FS_ALLOC_30", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(8532.42320819), 0U},
    {"FS_ALLOC_31", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(85324.2320819), 0U},
    {"FS_ALLOC_32", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_33", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(347222.222222), 0U},
    {"FS_ALLOC_40", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_41", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_42", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_43", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_50", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_51", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_52", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_53", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_60", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_61", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_62", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_63", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_70", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_71", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_72", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_ALLOC_73", FS_LIT(-1000000000000000.0), FS_LIT(1000000000000000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_00", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(2.93e-05), 0U},
    {"FS_EFF_01", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(2.93e-05), 0U},
    {"FS_EFF_02", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(2.93e-05), 0U},
    {"FS_EFF_03", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(2.93e-05), 0U},
    {"FS_EFF_04", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_05", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_06", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_07", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_10", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-0.0), 0U},
    {"FS_EFF_11", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-5.86e-06), 0U},
    {"FS_EFF_12", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-0.0), 0U},
    {"FS_EFF_13", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(5.86e-06), 0U},
    {"FS_EFF_14", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_15", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_16", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_17", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_20", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(5.86e-06), 0U},
    {"FS_EFF_21", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_22", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-5.86e-06), 0U},
    {"FS_EFF_23", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_24", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_25", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_26", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_27", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_30", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-7.2e-07), 0U},
    {"FS_EFF_31", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(7.2e-07), 0U},
    {"FS_EFF_32", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(-7.2e-07), 0U},
    {"FS_EFF_33", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(7.2e-07), 0U},
    {"FS_EFF_34", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_35", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_36", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_EFF_37", FS_LIT(-1000.0), FS_LIT(1000.0), FS_LIT(0.0), 0U},
    {"FS_LOW_0", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(900.0), 0U},
    {"FS_LOW_1", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(900.0), 0U},
    {"FS_LOW_2", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(900.0), 0U},
    {"FS_LOW_3", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(900.0), 0U},
    {"FS_LOW_4", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_LOW_5", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_LOW_6", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_LOW_7", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_HIGH_0", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(92073.3788396), 0U},
    {"FS_HIGH_1", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(92073.3788396), 0U},
    {"FS_HIGH_2", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(92073.3788396), 0U},
    {"FS_HIGH_3", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(92073.3788396), 0U},
    {"FS_HIGH_4", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_HIGH_5", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_HIGH_6", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_HIGH_7", FS_LIT(-1000000000000.0), FS_LIT(1000000000000.0), FS_LIT(0.0), 0U},
    {"FS_SPIN_0", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"FS_SPIN_1", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(-1.0), 0U},
    {"FS_SPIN_2", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(1.0), 0U},
    {"FS_SPIN_3", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(-1.0), 0U},
    {"FS_SPIN_4", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(0.0), 0U},
    {"FS_SPIN_5", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(0.0), 0U},
    {"FS_SPIN_6", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(0.0), 0U},
    {"FS_SPIN_7", FS_LIT(-1.0), FS_LIT(1.0), FS_LIT(0.0), 0U},
};

const fs_param_spec *fs_param_spec_at(uint16_t index)
{
    return &specs[index];
}

fs_real *fs_param_place(fs_loops *loops, uint16_t index)
{
    switch (index) {
    case 0U: return &loops->position.pid.kp_xy;
    case 1U: return &loops->position.pid.ki_xy;
    case 2U: return &loops->position.pid.kd_xy;
    case 3U: return &loops->position.pid.kp_z;
    case 4U: return &loops->position.pid.ki_z;
    case 5U: return &loops->position.pid.kd_z;
    case 6U: return &loops->position.pid.max_integral_m_s2;
    case 7U: return &loops->position.pid.max_thrust_n;
    case 8U: return &loops->position.pid.min_thrust_n;
    case 9U: return &loops->reference.bandwidth_rad_s;
    case 10U: return &loops->reference.damping;
    case 11U: return &loops->reference.max_rate_rad_s;
    case 12U: return &loops->reference.max_acceleration_rad_s2;
    case 13U: return &loops->controller.pid.kp_roll;
    case 14U: return &loops->controller.pid.kp_pitch;
    case 15U: return &loops->controller.pid.kp_yaw;
    case 16U: return &loops->controller.pid.ki_roll;
    case 17U: return &loops->controller.pid.ki_pitch;
    case 18U: return &loops->controller.pid.ki_yaw;
    case 19U: return &loops->controller.pid.kd_roll;
    case 20U: return &loops->controller.pid.kd_pitch;
    case 21U: return &loops->controller.pid.kd_yaw;
    case 22U: return &loops->controller.pid.rate_feedforward;
    case 23U: return &loops->controller.pid.acceleration_feedforward;
    case 24U: return &loops->controller.backstepping.c1;
    case 25U: return &loops->controller.backstepping.c2;
    case 26U: return &loops->controller.backstepping.c3;
    case 27U: return &loops->controller.backstepping.c4;
    case 28U: return &loops->controller.backstepping.c5;
    case 29U: return &loops->controller.backstepping.c6;
    case 30U: return &loops->controller.backstepping.rate_feedforward;
    case 31U: return &loops->controller.backstepping.acceleration_feedforward;
    case 32U: return &loops->setup.max_tilt_deg;
    case 33U: return &loops->setup.controller;
    case 34U: return &loops->setup.rotors;
    case 35U: return &loops->setup.inner_hz;
    case 36U: return &loops->setup.outer_divisor;
    case 37U: return &loops->position.pid.mass_kg;
    case 38U: return &loops->position.pid.gravity_m_s2;
    case 39U: return &loops->setup.ix_kg_m2;
    case 40U: return &loops->setup.iy_kg_m2;
    case 41U: return &loops->setup.iz_kg_m2;
    case 42U: return &loops->controller.backstepping.rotor_inertia_kg_m2;
    case 43U: return &loops->mixer.allocation[0][0];
    case 44U: return &loops->mixer.allocation[0][1];
    case 45U: return &loops->mixer.allocation[0][2];
    case 46U: return &loops->mixer.allocation[0][3];
    case 47U: return &loops->mixer.allocation[1][0];
    case 48U: return &loops->mixer.allocation[1][1];
    case 49U: return &loops->mixer.allocation[1][2];
    case 50U: return &loops->mixer.allocation[1][3];
    case 51U: return &loops->mixer.allocation[2][0];
    case 52U: return &loops->mixer.allocation[2][1];
    case 53U: return &loops->mixer.allocation[2][2];
    case 54U: return &loops->mixer.allocation[2][3];
    case 55U: return &loops->mixer.allocation[3][0];
    case 56U: return &loops->mixer.allocation[3][1];
    case 57U: return &loops->mixer.allocation[3][2];
    case 58U: return &loops->mixer.allocation[3][3];
    case 59U: return &loops->mixer.allocation[4][0];
    case 60U: return &loops->mixer.allocation[4][1];
    case 61U: return &loops->mixer.allocation[4][2];
    case 62U: return &loops->mixer.allocation[4][3];
    case 63U: return &loops->mixer.allocation[5][0];
    case 64U: return &loops->mixer.allocation[5][1];
    case 65U: return &loops->mixer.allocation[5][2];
    case 66U: return &loops->mixer.allocation[5][3];
    case 67U: return &loops->mixer.allocation[6][0];
    case 68U: return &loops->mixer.allocation[6][1];
    case 69U: return &loops->mixer.allocation[6][2];
    case 70U: return &loops->mixer.allocation[6][3];
    case 71U: return &loops->mixer.allocation[7][0];
    case 72U: return &loops->mixer.allocation[7][1];
    case 73U: return &loops->mixer.allocation[7][2];
    case 74U: return &loops->mixer.allocation[7][3];
    case 75U: return &loops->mixer.effectiveness[0][0];
    case 76U: return &loops->mixer.effectiveness[0][1];
    case 77U: return &loops->mixer.effectiveness[0][2];
    case 78U: return &loops->mixer.effectiveness[0][3];
    case 79U: return &loops->mixer.effectiveness[0][4];
    case 80U: return &loops->mixer.effectiveness[0][5];
    case 81U: return &loops->mixer.effectiveness[0][6];
    case 82U: return &loops->mixer.effectiveness[0][7];
    case 83U: return &loops->mixer.effectiveness[1][0];
    case 84U: return &loops->mixer.effectiveness[1][1];
    case 85U: return &loops->mixer.effectiveness[1][2];
    case 86U: return &loops->mixer.effectiveness[1][3];
    case 87U: return &loops->mixer.effectiveness[1][4];
    case 88U: return &loops->mixer.effectiveness[1][5];
    case 89U: return &loops->mixer.effectiveness[1][6];
    case 90U: return &loops->mixer.effectiveness[1][7];
    case 91U: return &loops->mixer.effectiveness[2][0];
    case 92U: return &loops->mixer.effectiveness[2][1];
    case 93U: return &loops->mixer.effectiveness[2][2];
    case 94U: return &loops->mixer.effectiveness[2][3];
    case 95U: return &loops->mixer.effectiveness[2][4];
    case 96U: return &loops->mixer.effectiveness[2][5];
    case 97U: return &loops->mixer.effectiveness[2][6];
    case 98U: return &loops->mixer.effectiveness[2][7];
    case 99U: return &loops->mixer.effectiveness[3][0];
    case 100U: return &loops->mixer.effectiveness[3][1];
    case 101U: return &loops->mixer.effectiveness[3][2];
    case 102U: return &loops->mixer.effectiveness[3][3];
    case 103U: return &loops->mixer.effectiveness[3][4];
    case 104U: return &loops->mixer.effectiveness[3][5];
    case 105U: return &loops->mixer.effectiveness[3][6];
    case 106U: return &loops->mixer.effectiveness[3][7];
    case 107U: return &loops->mixer.low[0];
    case 108U: return &loops->mixer.low[1];
    case 109U: return &loops->mixer.low[2];
    case 110U: return &loops->mixer.low[3];
    case 111U: return &loops->mixer.low[4];
    case 112U: return &loops->mixer.low[5];
    case 113U: return &loops->mixer.low[6];
    case 114U: return &loops->mixer.low[7];
    case 115U: return &loops->mixer.high[0];
    case 116U: return &loops->mixer.high[1];
    case 117U: return &loops->mixer.high[2];
    case 118U: return &loops->mixer.high[3];
    case 119U: return &loops->mixer.high[4];
    case 120U: return &loops->mixer.high[5];
    case 121U: return &loops->mixer.high[6];
    case 122U: return &loops->mixer.high[7];
    case 123U: return &loops->mixer.spin[0];
    case 124U: return &loops->mixer.spin[1];
    case 125U: return &loops->mixer.spin[2];
    case 126U: return &loops->mixer.spin[3];
    case 127U: return &loops->mixer.spin[4];
    case 128U: return &loops->mixer.spin[5];
    case 129U: return &loops->mixer.spin[6];
    case 130U: return &loops->mixer.spin[7];
    default: return NULL;
    }
}

fs_real fs_param_value(const fs_loops *loops, uint16_t index)
{
    switch (index) {
    case 0U: return loops->position.pid.kp_xy;
    case 1U: return loops->position.pid.ki_xy;
    case 2U: return loops->position.pid.kd_xy;
    case 3U: return loops->position.pid.kp_z;
    case 4U: return loops->position.pid.ki_z;
    case 5U: return loops->position.pid.kd_z;
    case 6U: return loops->position.pid.max_integral_m_s2;
    case 7U: return loops->position.pid.max_thrust_n;
    case 8U: return loops->position.pid.min_thrust_n;
    case 9U: return loops->reference.bandwidth_rad_s;
    case 10U: return loops->reference.damping;
    case 11U: return loops->reference.max_rate_rad_s;
    case 12U: return loops->reference.max_acceleration_rad_s2;
    case 13U: return loops->controller.pid.kp_roll;
    case 14U: return loops->controller.pid.kp_pitch;
    case 15U: return loops->controller.pid.kp_yaw;
    case 16U: return loops->controller.pid.ki_roll;
    case 17U: return loops->controller.pid.ki_pitch;
    case 18U: return loops->controller.pid.ki_yaw;
    case 19U: return loops->controller.pid.kd_roll;
    case 20U: return loops->controller.pid.kd_pitch;
    case 21U: return loops->controller.pid.kd_yaw;
    case 22U: return loops->controller.pid.rate_feedforward;
    case 23U: return loops->controller.pid.acceleration_feedforward;
    case 24U: return loops->controller.backstepping.c1;
    case 25U: return loops->controller.backstepping.c2;
    case 26U: return loops->controller.backstepping.c3;
    case 27U: return loops->controller.backstepping.c4;
    case 28U: return loops->controller.backstepping.c5;
    case 29U: return loops->controller.backstepping.c6;
    case 30U: return loops->controller.backstepping.rate_feedforward;
    case 31U: return loops->controller.backstepping.acceleration_feedforward;
    case 32U: return loops->setup.max_tilt_deg;
    case 33U: return loops->setup.controller;
    case 34U: return loops->setup.rotors;
    case 35U: return loops->setup.inner_hz;
    case 36U: return loops->setup.outer_divisor;
    case 37U: return loops->position.pid.mass_kg;
    case 38U: return loops->position.pid.gravity_m_s2;
    case 39U: return loops->setup.ix_kg_m2;
    case 40U: return loops->setup.iy_kg_m2;
    case 41U: return loops->setup.iz_kg_m2;
    case 42U: return loops->controller.backstepping.rotor_inertia_kg_m2;
    case 43U: return loops->mixer.allocation[0][0];
    case 44U: return loops->mixer.allocation[0][1];
    case 45U: return loops->mixer.allocation[0][2];
    case 46U: return loops->mixer.allocation[0][3];
    case 47U: return loops->mixer.allocation[1][0];
    case 48U: return loops->mixer.allocation[1][1];
    case 49U: return loops->mixer.allocation[1][2];
    case 50U: return loops->mixer.allocation[1][3];
    case 51U: return loops->mixer.allocation[2][0];
    case 52U: return loops->mixer.allocation[2][1];
    case 53U: return loops->mixer.allocation[2][2];
    case 54U: return loops->mixer.allocation[2][3];
    case 55U: return loops->mixer.allocation[3][0];
    case 56U: return loops->mixer.allocation[3][1];
    case 57U: return loops->mixer.allocation[3][2];
    case 58U: return loops->mixer.allocation[3][3];
    case 59U: return loops->mixer.allocation[4][0];
    case 60U: return loops->mixer.allocation[4][1];
    case 61U: return loops->mixer.allocation[4][2];
    case 62U: return loops->mixer.allocation[4][3];
    case 63U: return loops->mixer.allocation[5][0];
    case 64U: return loops->mixer.allocation[5][1];
    case 65U: return loops->mixer.allocation[5][2];
    case 66U: return loops->mixer.allocation[5][3];
    case 67U: return loops->mixer.allocation[6][0];
    case 68U: return loops->mixer.allocation[6][1];
    case 69U: return loops->mixer.allocation[6][2];
    case 70U: return loops->mixer.allocation[6][3];
    case 71U: return loops->mixer.allocation[7][0];
    case 72U: return loops->mixer.allocation[7][1];
    case 73U: return loops->mixer.allocation[7][2];
    case 74U: return loops->mixer.allocation[7][3];
    case 75U: return loops->mixer.effectiveness[0][0];
    case 76U: return loops->mixer.effectiveness[0][1];
    case 77U: return loops->mixer.effectiveness[0][2];
    case 78U: return loops->mixer.effectiveness[0][3];
    case 79U: return loops->mixer.effectiveness[0][4];
    case 80U: return loops->mixer.effectiveness[0][5];
    case 81U: return loops->mixer.effectiveness[0][6];
    case 82U: return loops->mixer.effectiveness[0][7];
    case 83U: return loops->mixer.effectiveness[1][0];
    case 84U: return loops->mixer.effectiveness[1][1];
    case 85U: return loops->mixer.effectiveness[1][2];
    case 86U: return loops->mixer.effectiveness[1][3];
    case 87U: return loops->mixer.effectiveness[1][4];
    case 88U: return loops->mixer.effectiveness[1][5];
    case 89U: return loops->mixer.effectiveness[1][6];
    case 90U: return loops->mixer.effectiveness[1][7];
    case 91U: return loops->mixer.effectiveness[2][0];
    case 92U: return loops->mixer.effectiveness[2][1];
    case 93U: return loops->mixer.effectiveness[2][2];
    case 94U: return loops->mixer.effectiveness[2][3];
    case 95U: return loops->mixer.effectiveness[2][4];
    case 96U: return loops->mixer.effectiveness[2][5];
    case 97U: return loops->mixer.effectiveness[2][6];
    case 98U: return loops->mixer.effectiveness[2][7];
    case 99U: return loops->mixer.effectiveness[3][0];
    case 100U: return loops->mixer.effectiveness[3][1];
    case 101U: return loops->mixer.effectiveness[3][2];
    case 102U: return loops->mixer.effectiveness[3][3];
    case 103U: return loops->mixer.effectiveness[3][4];
    case 104U: return loops->mixer.effectiveness[3][5];
    case 105U: return loops->mixer.effectiveness[3][6];
    case 106U: return loops->mixer.effectiveness[3][7];
    case 107U: return loops->mixer.low[0];
    case 108U: return loops->mixer.low[1];
    case 109U: return loops->mixer.low[2];
    case 110U: return loops->mixer.low[3];
    case 111U: return loops->mixer.low[4];
    case 112U: return loops->mixer.low[5];
    case 113U: return loops->mixer.low[6];
    case 114U: return loops->mixer.low[7];
    case 115U: return loops->mixer.high[0];
    case 116U: return loops->mixer.high[1];
    case 117U: return loops->mixer.high[2];
    case 118U: return loops->mixer.high[3];
    case 119U: return loops->mixer.high[4];
    case 120U: return loops->mixer.high[5];
    case 121U: return loops->mixer.high[6];
    case 122U: return loops->mixer.high[7];
    case 123U: return loops->mixer.spin[0];
    case 124U: return loops->mixer.spin[1];
    case 125U: return loops->mixer.spin[2];
    case 126U: return loops->mixer.spin[3];
    case 127U: return loops->mixer.spin[4];
    case 128U: return loops->mixer.spin[5];
    case 129U: return loops->mixer.spin[6];
    case 130U: return loops->mixer.spin[7];
    default: return FS_LIT(0.0);
    }
}

uint16_t fs_param_is_consistent(const fs_loops *loops)
{
    return (loops->position.pid.min_thrust_n <= loops->position.pid.max_thrust_n) ? 1U : 0U;
}

fs_real *fs_param_integral(fs_loops *loops, uint16_t index)
{
    switch (index) {
    case 16U: return &loops->controller_memory.pid.roll;
    case 17U: return &loops->controller_memory.pid.pitch;
    case 18U: return &loops->controller_memory.pid.yaw;
    default: return NULL;
    }
}
