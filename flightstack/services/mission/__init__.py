"""The mission service: upload, storage and download of missions, geofences and rally points."""
