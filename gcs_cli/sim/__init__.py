"""``gcs sim``: simulators and flight stacks of one or several vehicles in one command."""
