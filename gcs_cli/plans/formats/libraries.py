"""The libraries of the extra ``formats``, and the XML that they may read."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from flightstack.core.errors import ConfigError
from gcs_cli.errors import USAGE, CliError

_DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")


def library(name: str) -> None:
    """Raise CliError (usage) if the library ``name`` is not installed."""
    if find_spec(name) is None:
        raise CliError(f"this format needs {name}: pip install 'flightstack[formats]'", USAGE)


def parse_xml(name: str, parse: Callable[[str], Any], text: str, file: object) -> Any:
    """Return what a library's ``parse`` makes of the text of a ``name`` file; raise ConfigError for a bad one.

    A document type is refused: it can define entities without end.
    """
    try:
        if "<!DOCTYPE" in text:
            raise ValueError("it has a document type")
        return parse(_DECLARATION.sub("", text))
    except Exception as error:  # the parsers raise many types
        reason = str(error) or repr(error)
        raise ConfigError(file, "", f"is not valid {name}: {reason.splitlines()[0]:.120}") from None
