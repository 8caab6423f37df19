"""A MAVLink quadcopter flight stack: pure control and guidance, sans-IO services, lockstep or real time."""

__version__ = "0.1.0"
