"""Firmware in C: sources, build, parameters, and loops that run in C or on a target."""
