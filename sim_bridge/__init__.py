"""The plant simulator: vehicle, rotors, wind and ground, served to a flight stack in lockstep.

PYTEST_DONT_REWRITE: pytest warns of a plugin's package that is imported before it starts.
"""
