"""Widgets and drawing that several screens use."""
