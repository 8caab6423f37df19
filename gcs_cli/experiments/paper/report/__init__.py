"""The report of ``gcs paper``."""
