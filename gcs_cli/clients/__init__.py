"""Clients of the MAVLink services, sans-IO."""
