"""A line of text in runs of one style: built and compared faster than Rich's ``Text``, for lines that always change."""

from __future__ import annotations

from typing import TypeAlias

from rich.style import Style

Run: TypeAlias = tuple[str, str | Style]


class Runs(tuple[Run, ...]):
    """The runs of a line, from left to right."""

    __slots__ = ()

    @property
    def plain(self) -> str:
        """The characters."""
        return "".join(text for text, _ in self)
