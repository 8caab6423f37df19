"""Peers of the vehicle, routing between them, and signing."""
