"""The log download service."""
