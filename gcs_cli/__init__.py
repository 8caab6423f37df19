"""The ground station on the command line: `gcs`."""
