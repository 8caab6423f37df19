"""Sensor models of the simulator. There are none yet: the vehicle flies on the true state."""
