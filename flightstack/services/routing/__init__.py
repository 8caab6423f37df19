"""Peers of the vehicle, message routing between them, and message signing."""
