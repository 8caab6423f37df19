"""The screen Fly: the state of the vehicle on one page."""
