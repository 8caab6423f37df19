"""System tools that tests need: without one a test is skipped, but where CI installs them all, it fails."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest


def missing(sentence: str) -> NoReturn:
    """Skip the test because of a tool that is not there; in continuous integration that is an error."""
    if os.environ.get("CI"):
        pytest.fail(sentence, pytrace=False)
    pytest.skip(sentence)
