"""Vehicle side of the MAVLink services: peers, protocols and telemetry. No I/O, no clock."""
