"""Conformance of a port: checks over its link whether a target keeps the contract of the firmware."""
