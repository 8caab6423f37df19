"""Stories: tests whose body is an asynchronous function that runs beside MAVSDK, in the client's process."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Sequence

import pytest

from tests.interop.client_process import CONNECTED, FAILED, PASSED
from tests.interop.stack import HOST, RealVehicle
from tests.support.process import Process
from tests.support.tools import NIGHTLY

API, GROUND, TCP = "api", "ground", "tcp"
"""Links: UDP to the API port and to the ground station's port, and TCP to the vehicle's."""


class StoryFailedError(AssertionError):
    """A story did not come to its end."""


class Client:
    """A program with MAVSDK, connected to a vehicle."""

    def __init__(self, vehicle: RealVehicle, link: str) -> None:
        self.vehicle = vehicle
        self.link = link
        url = {
            API: f"udpin://{HOST}:{vehicle.api_port}",
            GROUND: f"udpin://{HOST}:{vehicle.gcs_port}",
            TCP: f"tcpout://{HOST}:{vehicle.tcp_port}",
        }[link]
        self._process = Process("tests.interop.client_process", url, listens=True)
        self._await(CONNECTED)

    def run(self, test: Callable[..., object], **arguments: object) -> None:
        """Run the story of a test to its end."""
        self.begin(test, **arguments)
        self.finish()

    def begin(self, test: Callable[..., object], **arguments: object) -> None:
        """Let a story begin, so that another client's can run beside it."""
        self._process.tell(json.dumps([test.__module__, test.__name__, arguments]))

    def finish(self) -> None:
        """Wait for the end of the story that was begun."""
        self._await(PASSED)

    def _await(self, wanted: str) -> None:
        said: list[str] = []
        while (line := self._process.next_line()) is not None:
            if wanted in line:
                return
            said.append(line)
            if FAILED in line:
                break
        else:
            said.append("(silent for too long, or dead)\n")
        story = "".join(said)
        raise StoryFailedError(f"--- client on {self.link}\n{story}\n{self.vehicle.output}")

    def stop(self) -> None:
        """End the process in order."""
        assert self._process.end() == 0, self._process.output

    def kill(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()


Story = Callable[..., Awaitable[None]]


def story(
    *, speeds: Sequence[float] = (10.0,), links: Sequence[str] = (API,), by_night: Sequence[str] = ()
) -> Callable[[Story], Story]:
    """Make a test of ``async def test_…(drone, …)``, run at each speed over each link, with NIGHTLY=1 over more links.

    Arguments after ``drone`` are those of a test that is not made here, and runs the story by :meth:`Client.run`.
    """

    def made(function: Story) -> Story:
        def test(client: Client) -> None:
            client.run(function)

        test.__name__, test.__doc__, test.__module__ = (
            function.__name__,
            function.__doc__,
            function.__module__,
        )
        test.story = function  # type: ignore[attr-defined]
        used = (*links, *by_night) if NIGHTLY else links
        flights = [pytest.param((speed, link), id=f"{speed:g}x-{link}") for speed in speeds for link in used]
        return pytest.mark.parametrize("client", flights, indirect=True)(test)  # type: ignore[return-value]

    return made
