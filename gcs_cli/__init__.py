"""The ground station on the command line: `gcs`.

PYTEST_DONT_REWRITE: pytest warns of a plugin's package that is imported before it starts.
"""
