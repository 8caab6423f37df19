"""The factories of the fixtures ``sitl`` and ``sitl_server``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from flightstack.plan import Plan
from flightstack.testing.artifacts import Flown
from flightstack.testing.flight import Flight
from flightstack.testing.owners import Owners
from flightstack.testing.server import Server
from flightstack.testing.setup import Setup
from flightstack.testing.world import World

_WORLD_OPTIONS = ("telemetry", "make_engine")


class Sitl:
    """Makes worlds that end with the test or the fixture that made them."""

    def __init__(self, owners: Owners, rootpath: Path) -> None:
        self._owners = owners
        self._rootpath = rootpath
        self._flown: dict[object, list[Flown]] = {}
        """Worlds by owner, the last one last."""
        self._has_new_example = False

    def __call__(self, setup: Setup | None = None, **conditions: Any) -> World:
        """Return a new World with ``conditions`` as of ``World`` and ``Setup``; raise ConfigError.

        Plan files are looked for in the directory of the test's file, in pytest's root directory, and among the
        example plans. In a test with hypothesis the world is closed after each example.
        """
        return self._open(setup, conditions).world

    def fly(
        self,
        plan: str | Path | Plan,
        setup: Setup | None = None,
        *,
        limit_s: float | None = None,
        **conditions: Any,
    ) -> Flight:
        """Fly a plan in a new world to its end, as ``World.fly``; return the flight, whatever its outcome."""
        flown = self._open(setup, conditions)
        with flown.world as world:
            flown.flight = world.fly(plan, limit_s)
        return flown.flight

    def latest(self, item: object) -> Flown | None:
        """Return the newest world of a test, else of the fixtures that are set up; None if there is none."""
        own = self._flown.get(item)
        every = own or [flown for worlds in self._flown.values() for flown in worlds]
        return every[-1] if every else None

    def _open(self, setup: Setup | None, conditions: dict[str, Any]) -> Flown:
        options = {name: conditions.pop(name) for name in _WORLD_OPTIONS if name in conditions}
        if setup is None:
            conditions.setdefault("folder", (self._owners.folder, self._rootpath))
            setup = Setup.of(conditions)
        elif conditions:
            raise TypeError(f"give a Setup or {', '.join(conditions)}, not both")
        flown = Flown(World(setup, **options))
        self._keep(flown)
        return flown

    def _keep(self, flown: Flown) -> None:
        owner = self._owners.key
        if owner not in self._flown:
            self._flown[owner] = []
            self._owners.add_finalizer(lambda: self._end(owner))
        worlds = self._flown[owner]
        if self._has_new_example:
            worlds.clear()
            self._has_new_example = False
        worlds.append(flown)
        if not self._owners.is_fixture and (hypothesis := _of_example()) is not None:
            hypothesis.control.cleanup(lambda: self._end_example(flown))

    def _end_example(self, flown: Flown) -> None:
        """Close a world of an example of hypothesis; it is kept until the next example, as this one may fail."""
        flown.world.close()
        self._has_new_example = True

    def _end(self, owner: object) -> None:
        for flown in self._flown.pop(owner):
            flown.world.close()
        self._has_new_example = False


def _of_example() -> Any:
    """Return hypothesis in an example of it, or None; it is imported by the tests that use it."""
    hypothesis = sys.modules.get("hypothesis")
    return hypothesis if hypothesis is not None and hypothesis.currently_in_test_context() else None


class SitlServer:
    """Starts vehicles as processes that end with the test or the fixture that started them."""

    def __init__(self, owners: Owners, make_folder: Callable[[], Path]) -> None:
        self._owners = owners
        self._make_folder = make_folder
        self.running: list[Server] = []
        """Servers of tests and fixtures that are not over, whether stopped or not."""

    def __call__(
        self, *, speed: float = 1.0, timeout_s: float = 180.0, faults: Sequence[str] = (), **conditions: Any
    ) -> Server:
        """Start simulator and flight stack, and wait until the vehicle is healthy; raise ServerError, ConfigError.

        ``speed`` is a multiple of real time, ``conditions`` are those of ``Setup``; ``timeout_s`` is wall time.
        ``faults`` are those of ``sim-bridge --fault``, with times since the start of the simulator.
        """
        folder = self._make_folder()
        server = Server(Setup.of(conditions), folder, speed=speed, timeout_s=timeout_s, faults=faults)
        self.running.append(server)
        self._owners.add_finalizer(lambda: self._stop(server))
        return server

    def _stop(self, server: Server) -> None:
        if server in self.running:
            self.running.remove(server)
        server.stop()

    def stop_all(self) -> None:
        """Stop all servers."""
        for server in tuple(self.running):
            self._stop(server)
