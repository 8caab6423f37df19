"""Telemetry: which messages, at which rates, and how each is made from the status."""
