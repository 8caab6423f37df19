"""Differences between autopilots: modes, altitudes, arming, streams, parameters. One module per autopilot."""
