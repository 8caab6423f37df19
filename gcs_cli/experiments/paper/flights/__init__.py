"""Flights of the paper's experiments: cases, trajectories, closed loop, and the figures of a recording."""
