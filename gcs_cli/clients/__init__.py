"""The client halves of the MAVLink services, without I/O."""
