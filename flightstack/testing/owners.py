"""The fixture or test that a world belongs to, which ends with it. A module of its own: imports nothing heavy."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


class Owners:
    """Tracks the running test and the fixtures that are set up."""

    def __init__(self) -> None:
        self._item: pytest.Item | None = None
        self._requests: list[pytest.FixtureRequest] = []

    @contextlib.contextmanager
    def running(self, item: pytest.Item) -> Iterator[None]:
        """Track a test while it runs."""
        self._item = item
        try:
            yield
        finally:
            self._item = None

    @contextlib.contextmanager
    def setting_up(self, request: pytest.FixtureRequest) -> Iterator[None]:
        """Track a fixture while it is set up."""
        self._requests.append(request)
        try:
            yield
        finally:
            self._requests.pop()

    @property
    def is_fixture(self) -> bool:
        """True while a fixture is set up."""
        return bool(self._requests)

    @property
    def key(self) -> object:
        """The fixture that is set up, else the running test."""
        return self._requests[-1] if self._requests else self._item

    @property
    def folder(self) -> Path:
        """The directory of the running test's file."""
        return Path() if self._item is None else self._item.path.parent

    def add_finalizer(self, end: Callable[[], None]) -> None:
        """Call ``end`` when the owner ends."""
        if self._requests:
            self._requests[-1].addfinalizer(end)
        elif self._item is not None:
            self._item.addfinalizer(end)
