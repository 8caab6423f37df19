"""MAVLink without I/O: dialect, frames, telemetry, services."""
