"""The link to the simulator: frames, their layout, and the endpoint of the flight stack."""
