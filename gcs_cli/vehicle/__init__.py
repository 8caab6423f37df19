"""State, modes, texts and parameters of the vehicle."""
