"""``gcs fly``: start simulator and flight stack, fly a mission, write the results."""
