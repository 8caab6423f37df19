"""The screen Plot: telemetry fields over time."""
