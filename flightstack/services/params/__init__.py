"""The parameter service."""
