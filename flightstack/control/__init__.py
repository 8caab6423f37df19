"""Control laws, mixer and control loops."""
