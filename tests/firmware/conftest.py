"""Fixtures of several files of tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.app_support import Target


@pytest.fixture
def target() -> Iterator[Target]:
    """A target that has started."""
    made = Target()
    yield made
    made.close()
