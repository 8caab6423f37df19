"""``gcs replay``: a log as a vehicle that any client can watch."""
