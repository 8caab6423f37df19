"""Commands of the user in the terminal view: values, confirmation, and the choice of the vehicle."""
