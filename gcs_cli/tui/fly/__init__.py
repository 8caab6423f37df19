"""The screen Fly: the state of the vehicle at one look."""
