"""``gcs pil`` compiles the firmware while the first flight flies."""

from __future__ import annotations

import io
import threading
from pathlib import Path

import pytest

from flightstack.firmware.choice import parse_loops
from flightstack.firmware.sources import firmware_root
from flightstack.firmware.toolchain.build import BuildError
from flightstack.transports.byte_link import LineError
from gcs_cli.errors import USAGE, CliError
from gcs_cli.pil import targets

HOST = parse_loops("host")


@pytest.fixture(autouse=True)
def without_compilers(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("check_tools", "host_library", "open_link", "stack_usage"):
        monkeypatch.setattr(targets, name, lambda *_: io.BytesIO())


def test_flight_begins_before_the_compilation_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    flies, roots = threading.Event(), list[Path]()

    def compile_slowly() -> None:
        flies.wait()
        roots.append(firmware_root())

    monkeypatch.setattr(targets, "host_library", compile_slowly)
    with targets.building(HOST, "pid") as firmware:
        assert not firmware.built.done()
        flies.set()
        firmware.wait()
        assert roots == [firmware_root()]  # the thread compiles the sources of the context
    assert firmware.tree is None


def test_failed_compilation_is_an_error_of_the_next_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise BuildError("the firmware does not compile with cc: no message")

    monkeypatch.setattr(targets, "host_library", fail)
    with (
        targets.building(HOST, "pid") as firmware,
        pytest.raises(CliError, match="does not compile with cc") as raised,
    ):
        firmware.wait()
    assert raised.value.exit_code == USAGE


@pytest.mark.parametrize(
    ("target", "name", "error"),
    [
        ("host", "check_tools", BuildError("no C compiler found")),
        ("serial:/dev/ttyNONE", "open_link", LineError("/dev/ttyNONE: no such port")),
    ],
)
def test_missing_tool_or_board_is_reported_before_a_flight(
    monkeypatch: pytest.MonkeyPatch, target: str, name: str, error: Exception
) -> None:
    def fail(_: object) -> None:
        raise error

    monkeypatch.setattr(targets, name, fail)
    with pytest.raises(CliError, match=str(error)), targets.building(parse_loops(target), "pid"):
        pytest.fail("a flight began")
