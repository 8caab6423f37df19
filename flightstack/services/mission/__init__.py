"""The mission service: missions, geofences and rally points uploaded, kept and downloaded."""
