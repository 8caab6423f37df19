"""What clients stream to the vehicle: setpoints, manual control, time synchronisation."""
