"""The targets for the loops: the value of ``--target``, its meaning, and a check that it exists."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from pathlib import Path
from typing import NamedTuple

from flightstack.firmware.choice import EMULATED, HOST, SERIAL, C, LoopsChoice, parse_loops
from flightstack.firmware.law_tree import controller_named, firmware_for, is_built_in
from flightstack.firmware.targets import check_tools, open_link
from flightstack.firmware.toolchain.build import BuildError, host_library
from flightstack.firmware.toolchain.stack_usage import stack_usage
from flightstack.transports.byte_link import LineError
from gcs_cli.errors import USAGE, CliError

MEANINGS = {
    C: "The target is the C core inside this program, compiled for this machine.",
    HOST: (
        "The third flight is not PIL on a board, but SIL in another process: the whole C program, with its protocol, "
        "on this machine behind a pseudo terminal. It checks program and protocol on this processor only."
    ),
    EMULATED: (
        "PIL: the whole firmware, cross-compiled for a Cortex-M4F and executed by an emulator, instruction by "
        "instruction, on this machine. It stands for no board: nothing here was measured on an F28377S."
    ),
}
_SERIAL_MEANING = (
    "PIL: the firmware on the board named below, stepped over its serial port in simulated time."
)
_STAGES = "MIL: the loops in Python, float64. SIL: the loops in C, float32, inside the flight stack. "


def checked_target(text: str, more: tuple[str, ...] = (), flag: str = "--target") -> LoopsChoice:
    """Read ``emulated``, ``host``, ``serial:DEVICE[:BAUD]`` or one of ``more``; raise CliError (usage), ConfigError.

    ``flag`` is the name of the option, for the error.
    """
    if text.partition(":")[0] not in (HOST, EMULATED, SERIAL, *more):
        known = ", ".join([EMULATED, HOST, *more])
        raise CliError(f"{flag} {text}: expected {known} or serial:DEVICE[:BAUD]", USAGE)
    choice = parse_loops(text, flag)
    if choice.ending:
        raise CliError(
            f"{flag} {text}: every stage is compared, which needs full reports: leave out ,{choice.ending}",
            USAGE,
        )
    return choice


def port_or_target(port: str | None, target: str | None) -> LoopsChoice:
    """Return the target of ``--port`` or ``--target``; raise CliError (usage), ConfigError."""
    if (port is None) == (target is None):
        raise CliError("give either --port DEVICE or --target", USAGE)
    return checked_target(f"serial:{port}" if target is None else target)


def check_there(target: LoopsChoice, controller: str) -> Path | None:
    """Return the folder of the firmware that was generated for a user's controller.

    Raise CliError (usage) if the target does not open, ConfigError if the controller has no C.
    """
    law = controller_named(controller)
    try:
        with firmware_for(law) as tree:
            host_library()
            open_link(target).close()
            return None if is_built_in(law) else tree
    except (BuildError, LineError) as error:
        raise CliError(str(error), USAGE) from None


@contextmanager
def building(target: LoopsChoice, controller: str) -> Iterator[FirmwareBuild]:
    """Compile the firmware of a controller for this machine and the target in a thread, while the first flight flies.

    Raise CliError (usage) if a tool is missing or a board does not answer, ConfigError if the controller has no C. The
    end of the context waits for the compilers.
    """
    law = controller_named(controller)
    with ThreadPoolExecutor(1) as executor, firmware_for(law) as tree:
        try:
            check_tools(target)
            if target.kind == SERIAL:  # before a flight
                open_link(target).close()
        except (BuildError, LineError) as error:
            raise CliError(str(error), USAGE) from None
        built = executor.submit(copy_context().run, _build, target)
        yield FirmwareBuild(None if is_built_in(law) else tree, built)


class FirmwareBuild(NamedTuple):
    """Firmware that is being compiled."""

    tree: Path | None
    """Folder of the firmware that was generated for a user's controller."""
    built: Future[None]

    def wait(self) -> None:
        """Wait until it is compiled; raise CliError (usage) if that fails."""
        try:
            self.built.result()
        except (BuildError, LineError) as error:
            raise CliError(str(error), USAGE) from None


def _build(target: LoopsChoice) -> None:
    """Compile what the flights and the report need: loops, target, and the stack usage, which is kept."""
    host_library()
    if target.kind != SERIAL:
        open_link(target).close()
    stack_usage()


def has_same_bits(target: LoopsChoice) -> bool:
    """Return True if the target's arithmetic is bit-identical to the host's; a board's may differ."""
    return target.kind in (C, HOST, EMULATED)


def meaning(target: LoopsChoice, replay: bool = False) -> str:
    """Return a description of the results on this target and their limits."""
    words = MEANINGS.get(target.kind, _SERIAL_MEANING)
    return words if replay else _STAGES + words
