"""Libraries of the extra ``export``, imported when an export needs them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from gcs_cli.errors import USAGE, CliError

_PACKAGES = {"rerun": "rerun-sdk"}


def library(module: str) -> Any:
    """Return a module; raise CliError (usage) if it is not installed."""
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        package = _PACKAGES.get(name, name)
        raise CliError(f"this export needs {package}: pip install 'flightstack[export]'", USAGE) from None
