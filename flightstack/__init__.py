"""A MAVLink quadcopter flight stack: pure control and guidance, sans-IO services, lockstep or real time.

PYTEST_DONT_REWRITE: pytest warns of a plugin's package that is imported before it starts.
"""

__version__ = "0.1.0"
