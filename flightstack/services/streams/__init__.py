"""Streams from clients: offboard setpoints, manual control, time synchronisation, heartbeats."""
