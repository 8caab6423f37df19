"""Transfers of parameters, logs and plans between files and the vehicle."""
