"""Comparison of the loops in Python, in C and on a target: flights, replays, checks and reports."""
