"""Parameters, logs and plans transferred between files and the vehicle."""
