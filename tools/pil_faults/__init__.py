"""Faults planted into the C loops, and what a replay finds of each."""
