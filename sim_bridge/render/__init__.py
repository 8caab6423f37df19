"""Pictures and films of a flight; needs the extra ``multibody``."""
