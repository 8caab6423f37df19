"""Write a page after which figures are printed."""

from __future__ import annotations

from pathlib import Path

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.core.errors import ConfigError


def write_page(page: Path, text: str, overwrite: bool) -> ConfigError | OSError | None:
    """Write a page; return the error if it is not written, so that the caller can print its figures first."""
    try:
        check_new(page, overwrite)
        write_text_atomically(page, text)
    except (ConfigError, OSError) as error:
        return error
    return None
