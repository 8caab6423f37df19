"""The paper's experiments: flights, findings, linear analysis and report. Only ``gcs paper`` imports this package."""
