"""What is known of the vehicle: its state, modes, texts and parameters."""
