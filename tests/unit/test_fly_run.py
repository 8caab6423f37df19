"""The loop of ``gcs fly``: it exchanges messages while other work is done."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

from gcs_cli.fly import fly_run
from gcs_cli.fly.flight import Phase


def test_results_are_imported_once_beside_the_exchange_of_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle counts simulated time: a pause of 0.2 s is a lost ground station at 50 times real time."""
    importers: list[threading.Thread] = []
    is_imported = threading.Event()

    def import_module(name: str) -> None:
        importers.append(threading.current_thread())
        is_imported.set()

    class Connection:
        now_s, steps = 0.0, 0

        def step(self, until_s: float) -> None:
            if flight.phase is Phase.FLY:
                is_imported.wait()
            self.steps += 1
            flight.phase = Phase.FLY
            flight.is_over = self.steps == 4

    flight = SimpleNamespace(
        is_over=False,
        outcome=None,
        phase=Phase.CONNECT,
        view=SimpleNamespace(powered_off=False),
        step=lambda now_s: None,
    )
    children = SimpleNamespace(ended=list, notices=list)
    monkeypatch.setattr(fly_run, "importlib", SimpleNamespace(import_module=import_module))
    fly_run.run_flight(
        flight,
        Connection(),
        children,
        SimpleNamespace(reason=""),
        SimpleNamespace(update=lambda flight: None),
    )
    assert len(importers) == 1
    assert importers[0] is not threading.main_thread()
