"""``gcs watch`` as a process: on a terminal, in a pipe, in a browser."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import aiohttp
import pytest

from tests.support.browser import Page, chromium, page_socket
from tests.support.fake_vehicle import FakeVehicle, serve
from tests.support.terminal import terminal

LONG_S = 60  # a bound for a machine that is busy
GCS = [sys.executable, "-m", "gcs_cli"]


def link_to(vehicle: FakeVehicle) -> Iterator[list[str]]:
    with serve(vehicle) as udp:
        yield ["--connect", f"udpout:127.0.0.1:{udp.address[1]}"]


@pytest.fixture
def link() -> Iterator[list[str]]:
    yield from link_to(FakeVehicle())


def test_watch_prints_lines_without_a_terminal() -> None:
    vehicle = FakeVehicle()
    with serve(vehicle) as socket:
        command = [
            sys.executable,
            "-m",
            "gcs_cli",
            "watch",
            "--connect",
            f"udpout:127.0.0.1:{socket.address[1]}",
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            line = next(line for line in process.stdout if "HOLD" in line)
            process.send_signal(signal.SIGINT)
            assert process.wait(LONG_S) == 0
            assert "N +1.00 E +2.00 up 3.00 m" in line
            assert process.stderr.read() == ""


def test_a_reader_that_goes_away_ends_the_watch() -> None:
    with serve(FakeVehicle()) as socket:
        link = f"udpout:127.0.0.1:{socket.address[1]}"
        command = [sys.executable, "-m", "gcs_cli", "watch", "--connect", link]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.readline()
            process.stdout.close()
            assert process.wait(LONG_S) == 0
            assert process.stderr.read() == b""


def test_once_prints_one_screen(link: list[str]) -> None:
    environment = {**os.environ, "COLUMNS": "80", "LINES": "24"}
    result = subprocess.run(
        [*GCS, *link, "watch", "--once"],
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=True,
        env=environment,
    )
    lines = result.stdout.splitlines()
    assert len(lines) == 24
    assert "HOLD  DISARMED" in lines[0]
    assert "Position" in result.stdout
    assert "\x1b" not in result.stdout


FAILING = """
import sys
from gcs_cli.__main__ import main
from gcs_cli.tui.app import WatchApp
redraw = WatchApp.redraw
def fail(app):
    redraw(app)
    if app.feed.view.identity is not None:
        raise RuntimeError("drawing failed")
WatchApp.redraw = fail
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    "ending",
    [b"q", b"\x03", signal.SIGTERM, signal.SIGINT, signal.SIGHUP],
    ids=["q", "Ctrl-C", "SIGTERM", "SIGINT", "SIGHUP"],
)
def test_the_end_restores_the_terminal(link: list[str], ending: bytes | signal.Signals) -> None:
    with terminal(["-m", "gcs_cli", "watch", *link]) as screen:
        screen.read_until(b"Position")
        assert b"\x1b[?1049h" in screen.seen  # the alternate screen
        if isinstance(ending, bytes):
            screen.type(ending)
        else:
            screen.process.send_signal(ending)
        screen.read_until(b"\x1b[?1049l")
        assert screen.process.wait(LONG_S) == 0
        assert screen.is_restored()
        assert b"Traceback" not in screen.seen


@pytest.mark.parametrize("is_own", [True, False], ids=["SIGHUP", "no signal"])
def test_the_view_ends_with_its_terminal(link: list[str], is_own: bool) -> None:
    with terminal(["-m", "gcs_cli", "watch", *link], is_own=is_own) as screen:
        screen.read_until(b"Position")
        screen.type(b"1234567" * 20)  # more than the terminal holds, which nobody reads
        screen.hang_up()
        assert screen.process.wait(LONG_S) == 0


def test_an_exception_restores_the_terminal(link: list[str]) -> None:
    with terminal(["-c", FAILING, "watch", *link]) as screen:
        screen.read_until(b"drawing failed")
        assert screen.process.wait(LONG_S) == 1
        assert screen.is_restored()


def test_a_suspended_view_gives_the_terminal_back_and_draws_again(link: list[str]) -> None:
    with terminal(["-m", "gcs_cli", "watch", *link]) as screen:
        screen.read_until(b"Position")
        screen.type(b"\x1a")
        os.waitid(os.P_PID, screen.process.pid, os.WSTOPPED | os.WNOWAIT)
        screen.read_until(b"\x1b[?1049l")
        screen.seen = b""
        screen.process.send_signal(signal.SIGCONT)
        screen.read_until(b"Position")
        screen.type(b"q")
        assert screen.process.wait(LONG_S) == 0


def test_a_view_that_was_stopped_without_notice_draws_again_and_ends(link: list[str]) -> None:
    with terminal(["-m", "gcs_cli", "watch", *link]) as screen:
        screen.read_until(b"Position")
        screen.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, screen.process.pid, os.WSTOPPED | os.WNOWAIT)
        screen.seen = b""
        screen.process.send_signal(signal.SIGCONT)
        screen.read_until(b"Position")
        screen.type(b"q")
        assert screen.process.wait(LONG_S) == 0
        assert screen.is_restored()


def test_gcs_alone_on_a_terminal_opens_the_view() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        os.environ["GCS_CONNECT"] = f"udpout:127.0.0.1:{silent.getsockname()[1]}"
        try:
            with terminal(["-m", "gcs_cli"]) as screen:
                screen.read_until(b"heartbeat")
                screen.type(b"q")
                assert screen.process.wait(LONG_S) == 0
        finally:
            del os.environ["GCS_CONNECT"]


@contextmanager
def served(link: list[str]) -> Iterator[str]:
    """Serve the view; yield its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    command = [*GCS, *link, "watch", "--serve", address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"serving at http://{address}: Ctrl-C ends\n"
        try:
            yield f"http://{address}"
        except BaseException:
            process.kill()
            raise
        process.send_signal(signal.SIGINT)
        assert process.wait(LONG_S) == 0


async def open_view(page: Page, url: str) -> None:
    """Open the view, which loads nothing from another address, and wait for the vehicle."""
    await page.call("Network.enable")
    await page.call("Page.navigate", url=url)
    await page.wait("document.body.classList.contains('-first-byte')")
    loaded = await page.value("performance.getEntriesByType('resource').map(e => e.name).join(' ')")
    assert all(name.startswith(url) for name in loaded.split())
    await page.wait_for_frame("DISARMED")


def test_two_browsers_show_the_view_and_command_the_vehicle(tmp_path: Path) -> None:
    vehicle = FakeVehicle()

    async def visit(devtools: str, url: str) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(page_socket(devtools)) as first,
            session.ws_connect(page_socket(devtools)) as second,
        ):
            one, two = Page(first), Page(second)
            await open_view(one, url)
            await open_view(two, url)
            await one.type("A")
            await one.wait_for_frame("The rotors start")
            await one.type("y")
            await one.wait_for_frame(" ARMED ")
            await two.wait_for_frame("in air")
            assert vehicle.armed
            await two.type("D")
            await two.wait_for_frame("in the air?")
            await two.type("y")
            await one.wait_for_frame(" DISARMED ")

    with (
        serve(vehicle) as udp,
        served(["--connect", f"udpout:127.0.0.1:{udp.address[1]}"]) as url,
        chromium(tmp_path) as devtools,
    ):
        asyncio.run(asyncio.wait_for(visit(devtools, url), 4 * LONG_S))
    assert not vehicle.armed


def test_pages_of_other_origins_cannot_command_the_vehicle(link: list[str]) -> None:
    async def connect(url: str, origin: str | None) -> int:
        headers = {} if origin is None else {"Origin": origin}
        async with aiohttp.ClientSession() as session:
            try:
                async with session.ws_connect(f"{url}/ws", headers=headers) as ws:
                    await ws.receive(timeout=LONG_S)
                    return 101
            except aiohttp.WSServerHandshakeError as error:
                return error.status

    with served(link) as url:
        assert asyncio.run(connect(url, "http://evil.example")) == 403
        assert asyncio.run(connect(url, None)) == 403
        assert asyncio.run(connect(url, url)) == 101
