"""A dialog that shows what the vehicles send: the application asks it in each redraw to follow."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

from textual.screen import ModalScreen

R = TypeVar("R")


class LiveDialog(ModalScreen[R]):
    """A dialog over a screen, which is drawn less often below it."""

    @abstractmethod
    def follow(self) -> None:
        """Show the state of now."""
