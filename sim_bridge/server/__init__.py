"""The connection to the flight stack, in lockstep or paced."""
