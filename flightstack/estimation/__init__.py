"""Estimators; none is needed while the simulator sends the true state."""
