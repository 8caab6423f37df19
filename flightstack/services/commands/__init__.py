"""The command protocol, and the handlers of the commands."""
