"""Compile the firmware: for this machine, the emulated Cortex-M4F and boards; its images, stack and coverage."""
