"""The error of a program that own flights are compared with."""

from __future__ import annotations


class PeerError(RuntimeError):
    """A peer that cannot be measured."""
