"""The paper's experiments, flown, measured and reported; only ``gcs paper`` imports this package."""
