"""Vehicles, gains and parameters."""
