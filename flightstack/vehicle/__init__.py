"""The autopilot: composition of guidance, control and commander, and their common tick."""
