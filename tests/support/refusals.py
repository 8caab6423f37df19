"""Requests that the vehicle must refuse."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from flightstack.testing import RefusedError


@contextmanager
def refused(result: int | None = None, reason: str = "") -> Iterator[None]:
    """Expect a refusal with this MAV_RESULT or MAV_MISSION_RESULT, and with ``reason`` as a part of its reason."""
    with pytest.raises(RefusedError) as refusal:
        yield
    assert not refusal.value.is_silent
    assert result in (None, refusal.value.result), refusal.value
    assert reason in refusal.value.reason
