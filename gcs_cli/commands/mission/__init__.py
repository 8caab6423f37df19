"""``gcs mission``, ``fence`` and ``rally``: plans in files and on the vehicle."""
