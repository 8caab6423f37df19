"""Control laws, mixer and the loops that join them."""
