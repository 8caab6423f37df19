"""The equations of motion: body, rotors, battery, ground contact, wind and faults."""
