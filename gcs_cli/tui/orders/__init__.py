"""What the user orders the vehicle to do: values, question, and the choice of the vehicle."""
