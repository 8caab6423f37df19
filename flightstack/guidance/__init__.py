"""From modes and missions to the setpoints of the outer loop."""
