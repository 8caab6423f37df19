"""The commands of ``gcs``, one file each. Each imports what it needs only when it runs: help stays quick."""
