"""What each autopilot does in its own way: modes, altitudes, arming, streams, parameters. One module per autopilot."""
