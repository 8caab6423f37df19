"""MAVLink without I/O: dialect, frames, links, signing, and messages shared by vehicle and ground station."""
