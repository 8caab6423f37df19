"""``gcs``, run within the test: see :mod:`tests.support.commands`."""

from __future__ import annotations

from tests.support.commands import Ended, gcs

__all__ = ["Ended", "gcs"]
