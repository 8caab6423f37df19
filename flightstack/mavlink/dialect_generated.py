"""Generated from flightstack.xml by tools/generate_dialect.py: do not edit."""

from flightstack.mavlink.layout import Field, Layout

LAYOUTS = (
    Layout(
        291,
        "ESC_STATUS",
        10,
        (
            Field("time_usec", "Q", 1, False, "uint64_t", "us", 1),
            Field("rpm", "i", 4, True, "int32_t", "rpm", 2),
            Field("voltage", "f", 4, True, "float", "V", 3),
            Field("current", "f", 4, True, "float", "A", 4),
            Field("index", "B", 1, False, "uint8_t", "", 0),
        ),
    ),
    Layout(
        53000,
        "FS_PLANT_STATE",
        176,
        (
            Field("time_us", "Q", 1, False, "uint64_t", "us", 0),
            Field("position_ned_m", "d", 3, True, "double", "m", 1),
            Field("velocity_ned_m_s", "d", 3, True, "double", "m/s", 2),
            Field("q", "d", 4, True, "double", "", 3),
            Field("rates_frd_rad_s", "d", 3, True, "double", "rad/s", 4),
            Field("rotor_speed_rad_s", "f", 8, True, "float", "rad/s", 5),
            Field("rotor_count", "B", 1, False, "uint8_t", "", 6),
            Field("flags", "B", 1, False, "uint8_t", "", 7),
        ),
    ),
    Layout(
        53001,
        "FS_ACTUATORS",
        142,
        (
            Field("time_us", "Q", 1, False, "uint64_t", "us", 0),
            Field("rotor_speed_rad_s", "d", 8, True, "double", "rad/s", 1),
            Field("rotor_count", "B", 1, False, "uint8_t", "", 2),
            Field("flags", "B", 1, False, "uint8_t", "", 3),
        ),
    ),
    Layout(
        53002,
        "FS_LOOP_TIMING",
        12,
        (
            Field("time_us", "Q", 1, False, "uint64_t", "us", 0),
            Field("ticks", "I", 1, False, "uint32_t", "", 1),
            Field("overruns", "I", 1, False, "uint32_t", "", 2),
            Field("missed", "I", 1, False, "uint32_t", "", 3),
            Field("inner_hz", "f", 1, False, "float", "Hz", 4),
            Field("outer_hz", "f", 1, False, "float", "Hz", 5),
            Field("real_time_factor", "f", 1, False, "float", "", 6),
            Field("execution_mean_us", "f", 1, False, "float", "us", 7),
            Field("execution_p99_us", "f", 1, False, "float", "us", 8),
            Field("execution_max_us", "f", 1, False, "float", "us", 9),
            Field("lateness_mean_us", "f", 1, False, "float", "us", 10),
            Field("lateness_p99_us", "f", 1, False, "float", "us", 11),
            Field("lateness_max_us", "f", 1, False, "float", "us", 12),
            Field("clock", "B", 1, False, "uint8_t", "", 13),
        ),
    ),
)
