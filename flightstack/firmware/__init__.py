"""The firmware in C: its sources, how it is built, and the numbers it is given."""
