"""The autopilot: estimation, guidance, control and commander joined in one tick."""
