"""Mission tests: a vehicle in a simulated world, in one process and in simulated time.

    from flightstack.testing import World

    with World(vehicle="x_quad", wind=(5.0, 0.0), seed=3) as world:
        flight = world.fly("square.plan")
    assert flight.completed and flight.max_error_m < 0.5

The names of ``__all__`` are the public interface, with an example each in docs/reference/testing.md; other modules may
change. They are imported when they are used: this
package is imported by every run of pytest in its environment.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flightstack.testing.client import Client, ConditionTimeoutError, RefusedError
    from flightstack.testing.expression import SIGNALS
    from flightstack.testing.flight import Event, Flight, ModeSpan, Sample
    from flightstack.testing.link import Link
    from flightstack.testing.log import Log, Topic
    from flightstack.testing.properties import Margin, PropertyViolationError, Signals
    from flightstack.testing.scenario import Scenario, is_scenario, load_scenario
    from flightstack.testing.scenario_run import Verdict, run_scenario
    from flightstack.testing.setup import Setup
    from flightstack.testing.state import State
    from flightstack.testing.world import World

_HOMES = {
    "Client": "client",
    "ConditionTimeoutError": "client",
    "Event": "flight",
    "Flight": "flight",
    "Link": "link",
    "Log": "log",
    "Margin": "properties",
    "ModeSpan": "flight",
    "PropertyViolationError": "properties",
    "RefusedError": "client",
    "Scenario": "scenario",
    "SIGNALS": "expression",
    "Sample": "flight",
    "Setup": "setup",
    "Signals": "properties",
    "State": "state",
    "Topic": "log",
    "Verdict": "scenario_run",
    "World": "world",
    "is_scenario": "scenario",
    "load_scenario": "scenario",
    "run_scenario": "scenario_run",
}
"""The module of each public name."""

__all__ = [
    "SIGNALS", "Client", "ConditionTimeoutError", "Event", "Flight", "Link", "Log", "Margin", "ModeSpan",
    "PropertyViolationError", "RefusedError", "Sample", "Scenario", "Setup", "Signals", "State", "Topic", "Verdict",
    "World", "is_scenario", "load_scenario", "run_scenario",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
