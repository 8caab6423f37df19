"""``gcs fly``: simulator and flight stack started, a mission flown and watched."""
