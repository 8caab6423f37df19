"""The plant simulator: vehicle, rotors, wind and ground, served to a flight stack in lockstep."""
