"""Pictures and films of a flight; requires the extra ``multibody``."""
