"""What the machine gives the tests: tools (without one a test is skipped, but fails on CI), and time."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest

NIGHTLY = bool(os.environ.get("NIGHTLY"))
"""True if all samples and combinations are run, however long it takes; otherwise a part of them."""


def missing(sentence: str) -> NoReturn:
    """Skip the test because of a tool that is not there; in continuous integration that is an error."""
    if os.environ.get("CI"):
        pytest.fail(sentence, pytrace=False)
    pytest.skip(sentence)
