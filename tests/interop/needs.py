"""Clients from PyPI are part of the tests' dependencies, but a wheel may lack on a platform."""

from __future__ import annotations

import os
from importlib.util import find_spec

import pytest


def needs(module: str, distribution: str) -> None:
    """Skip the test module without the client; in continuous integration that is an error."""
    if find_spec(module) is not None:
        return
    sentence = f"{distribution} is not installed: pip install {distribution}"
    if os.environ.get("CI"):
        pytest.fail(sentence, pytrace=False)
    pytest.skip(sentence, allow_module_level=True)
