"""``gcs log``: logs on the vehicle and log files."""
