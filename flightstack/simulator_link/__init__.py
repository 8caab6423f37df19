"""The link to the simulator: lockstep frames and the endpoint of the flight stack."""
