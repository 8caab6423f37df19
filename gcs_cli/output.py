"""Lines of a command's result: sentences for people, or JSON objects for programs, one a line."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import typer


class Output:
    """Prints each fact as a sentence, or with ``as_json`` as one JSON object a line, flushed at once."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json

    def say(self, event: str, sentence: str, **facts: Any) -> None:
        """Print ``sentence``, or ``{"event": event, ...facts}``: SI units, degrees, null for unknown values."""
        if self.as_json:
            typer.echo(json.dumps({"event": event, **plain(facts)}, allow_nan=False))
        else:
            typer.echo(sentence)


def error_line(sentence: str, exit_code: int) -> str:
    """Return the JSON object of an error that ended a command."""
    return json.dumps({"event": "error", "message": sentence, "exit_code": exit_code})


def plain(value: Any) -> Any:
    """Return ``value`` as JSON can hold it: NumPy's numbers as Python's, NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, str | bytes):
        return value if isinstance(value, str) else value.hex()
    if isinstance(value, Sequence) or hasattr(value, "tolist"):
        listed = value.tolist() if hasattr(value, "tolist") else value
        return [plain(entry) for entry in listed] if isinstance(listed, Sequence) else plain(listed)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def can_draw() -> bool:
    """Return True if the output is a terminal that can draw, or a browser of textual-serve."""
    if "TEXTUAL_DRIVER" in os.environ:
        return True
    return (
        sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
    )
