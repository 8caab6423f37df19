"""Pictures of screens as text files beside the tests: compare them, or renew them with RENEW_PICTURES=1."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "screens" / "pictures"


def check_picture(name: str, lines: Sequence[str]) -> None:
    """Compare ``lines`` with the picture ``name``."""
    path = FOLDER / f"{name}.txt"
    text = "\n".join(line.rstrip() for line in lines) + "\n"
    if os.environ.get("RENEW_PICTURES"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8"), f"renew {path.name} with RENEW_PICTURES=1 if it is right"
