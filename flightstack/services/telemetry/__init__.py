"""Telemetry: messages from the vehicle status, and their rates on each link."""
