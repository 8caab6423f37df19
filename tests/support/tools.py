"""Requirements of tests: external tools, and nightly runs."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest

NIGHTLY = bool(os.environ.get("NIGHTLY"))
"""True to run all samples and combinations instead of a part of them."""


def missing(sentence: str) -> NoReturn:
    """Skip the test because of a missing tool; fail in continuous integration."""
    if os.environ.get("CI"):
        pytest.fail(sentence, pytrace=False)
    pytest.skip(sentence)
