"""Experiments that fly plant and loops in one process."""
