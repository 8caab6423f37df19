"""Faults and disturbances of the simulator: their table, schedule, conditions and effects."""
