"""MAVLink without I/O: dialect, frames, links, signing, and messages that both ends share."""
