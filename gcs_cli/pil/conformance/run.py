"""Run all conformance checks on a link."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from flightstack.firmware.c_loops import HostLoops
from flightstack.firmware.numbers import default_numbers
from flightstack.firmware.pil.steps import PilReport
from flightstack.firmware.sources import source_hash
from flightstack.firmware.toolchain.build import host_library
from flightstack.transports.byte_link import ByteLink
from gcs_cli.pil.conformance import link_checks, loop_checks, state_checks, time_checks
from gcs_cli.pil.conformance.check import FAILED, NOT_CHECKED, Check
from gcs_cli.pil.conformance.line import Line, status_of
from gcs_cli.pil.target_record import RESTARTED, state_words


def conformance(link: ByteLink, timeout_s: float, clock_s: Callable[[], float] | None) -> Iterator[Check]:
    """Yield the result of each check; raise BuildError without a C compiler, LineError if the link breaks.

    A target that does not answer ends the checks with the first one. ``clock_s``: see ``Line``.
    """
    line = Line(link, timeout_s, clock_s)
    identity = line.request("FS_PIL_IDENTITY")
    status = None if identity is None else line.request("FS_PIL_STATUS")
    if identity is None or status is None:
        yield Check("hello", FAILED, "the target does not answer", SILENT)
        return
    before = status_of(status)
    yield state_checks.hello(identity, source_hash())
    words = state_words(before["state"])
    yield state_checks.watchdog(words, words == RESTARTED)
    for check in (
        link_checks.all_bytes,
        link_checks.sizes,
        link_checks.burst,
        link_checks.corrupted,
        link_checks.cut_frame,
    ):
        yield check(line)
    yield from time_checks.time_base(line)
    yield from _loops(line, identity.char_bits, identity)
    after = line.request("FS_PIL_STATUS")
    if after is None:
        yield Check("losses", FAILED, "the target does not answer any more", SILENT)
        return
    yield state_checks.stack(status_of(after))
    yield state_checks.losses(before, status_of(after), line.own_frames)


SILENT = (
    "Is the firmware flashed, and does it run? Is this its port, and are these its baud rate (--baud), 8 data bits, no "
    "parity? A heartbeat leaves the target once a second: look for it at the transmit pin."
)


def _loops(line: Line, char_bits: int, identity: object) -> Iterator[Check]:
    numbers = default_numbers()
    yield loop_checks.parameters(line, numbers)
    yield loop_checks.read_back(line)
    checks, reports = _arithmetic(line, numbers, char_bits)
    yield from checks
    yield time_checks.cost_counter(identity, reports)
    yield state_checks.safe_state(line, len(reports))


def _arithmetic(line: Line, numbers: dict[str, float], char_bits: int) -> tuple[list[Check], list[PilReport]]:
    """Set the parameter that was changed back to its default, then compare the loops."""
    if not loop_checks.restore(line, numbers):
        reason = "a parameter could not be set to its default"
        return [Check("loops", NOT_CHECKED, reason, "See the other checks.")], []
    return loop_checks.arithmetic(line, HostLoops(host_library(), numbers), char_bits)
