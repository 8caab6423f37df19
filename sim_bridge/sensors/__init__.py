"""Sensor models: compiled functions from the true state to measurements, with seeded errors."""
