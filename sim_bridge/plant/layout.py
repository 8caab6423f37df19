"""Memory of a plant: one NumPy record, so that a call passes one argument and copies nothing."""

from __future__ import annotations

import numpy as np

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE
from flightstack.params.battery import MAX_CURVE_POINTS

MAX_POINTS = 2 * MAX_ROTORS
NOISE_ROWS = 1024
"""Steps for which noise is drawn at once; the next ones are kept ready too."""

CONTACT = 1  # result bits of ``advance``
DIVERGED = 2

ROTOR = np.dtype(
    [
        ("thrust", "f8"),  # N s², thrust over Ω·|Ω|
        ("roll", "f8"),  # N m s², torque about roll over Ω·|Ω|
        ("pitch", "f8"),  # N m s², torque about pitch over Ω·|Ω|
        ("drag", "f8"),  # N m s², torque of the air about yaw over Ω·|Ω|
        ("momentum", "f8"),  # kg m², angular momentum about yaw over Ω
        ("lag_rate", "f8"),  # 1/s, infinite without lag
        ("min_speed", "f8"),  # rad/s, of commands
        ("max_speed", "f8"),  # rad/s, of commands
        ("half_step_decay", "f8"),  # of the lag over half a step
        ("max_torque", "f8"),  # N m, of the drive
    ]
)
"""Constants of one rotor."""

MEMORY = np.dtype(
    [
        # state
        ("body", "f8", STATE_SIZE),  # each plant's own state vector
        ("stage", "f8", STATE_SIZE),  # Runge-Kutta: state of a stage
        ("slope", "f8", (4, STATE_SIZE)),  # Runge-Kutta: derivatives
        ("rotor_speed", "f8", MAX_ROTORS),  # rad/s
        ("command", "f8", MAX_ROTORS),  # last good command after the limits, rad/s
        ("bad_commands", "i8"),
        (
            "anchor",
            "f8",
            (MAX_POINTS, 3),
        ),  # of the friction spring of each contact point: x, y m on the ground, heading rad
        ("gust", "f8", 3),  # m/s NED
        ("torque_gust", "f8", 3),  # N m FRD
        ("torque", "f8", 3),  # external, steady and gusty, N m FRD
        ("noise", "f8", (2 * NOISE_ROWS, 3)),  # unit normal deviates of the wind, one row for each step
        ("torque_noise", "f8", (2 * NOISE_ROWS, 3)),  # the same of the torque
        ("noise_row", "i8"),
        ("charge", "f8"),  # of the battery, share of the capacity
        ("voltage", "f8"),  # of the battery, V
        ("current", "f8"),  # A
        ("consumed", "f8"),  # A s since the start
        ("energy", "f8"),  # J since the start
        # constants
        ("step_s", "f8"),
        ("rotor_count", "i8"),
        ("rotor", ROTOR, MAX_ROTORS),
        ("mass", "f8"),  # kg
        ("weight", "f8"),  # N
        ("inertia", "f8", 3),  # kg m²
        ("drag", "f8", 3),  # N s/m, body axes
        ("force", "f8", 3),  # external, N NED
        ("steady_torque", "f8", 3),  # external, N m FRD
        ("curve_count", "i8"),  # 0 without a battery
        ("curve", "f8", MAX_CURVE_POINTS),  # V, open circuit, at equal steps of charge from empty to full
        ("resistance", "f8"),  # ohm
        ("capacity", "f8"),  # A s
        ("drain", "f8"),  # factor on the discharge
        ("inverse_efficiency", "f8"),  # electric over mechanical power of the rotors
        ("avionics", "f8"),  # W
        ("wind", "f8", 3),  # steady, m/s NED
        ("gust_decay", "f8"),  # over one step
        ("gust_scale", "f8", 3),  # m/s, zero without gusts
        ("torque_gust_decay", "f8"),  # over one step
        ("torque_gust_scale", "f8", 3),  # N m, zero without a gusty torque
        ("ground", "i8"),  # 1 with a ground
        ("ground_z", "f8"),  # m along the normal of the ground, at which the contact springs are relaxed
        ("ground_slope", "f8", 2),  # sine and cosine; the ground rises to the north
        ("reach", "f8"),  # m, farthest contact point from the body origin
        ("point_count", "i8"),
        ("point", "f8", (MAX_POINTS, 3)),  # contact points FRD, m
        ("point_share", "f8", MAX_POINTS),  # of the stiffness
        ("stiffness", "f8"),  # N/m, all feet together
        ("damping", "f8"),  # N s/m, all feet together
        ("ramp", "f8"),  # m, depth of full damping
        ("lever", "f8"),  # m, mean distance of the feet from the vertical axis
        # faults and disturbances
        ("is_loaded", "i8"),  # 1 with a payload or a moved centre of gravity
        ("centre", "f8", 3),  # of gravity, m FRD
        ("inertia_matrix", "f8", (3, 3)),  # about the centre of gravity, kg m²
        ("inverse_inertia", "f8", (3, 3)),
        ("alters_air", "i8"),  # 1 with wind shear or ground effect
        ("shear", "f8"),  # exponent of the wind shear, 0 without
        ("surface_z", "f8"),  # m NED, of the ground
        ("rotor_z", "f8"),  # m FRD, mean of the rotors
        ("propeller_radius", "f8"),  # m, 0 without ground effect
    ],
    align=True,
)

OUTPUT = np.dtype([("state", "f8", STATE_SIZE), ("rotor_speed", "f4", MAX_ROTORS)])
"""Output of a plant, laid out as in FS_PLANT_STATE: array form of ``VehicleState``, rotor speeds."""
