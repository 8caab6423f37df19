"""An inspection flight: take off, take a photo at each point, return."""
