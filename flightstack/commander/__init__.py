"""Arming and modes."""
