"""Guidance: setpoints of the outer loop from modes and missions."""
