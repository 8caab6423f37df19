"""``gcs pil doctor --conformance``."""

from __future__ import annotations

import time
from contextlib import closing

from flightstack.core.errors import TargetError
from flightstack.firmware.choice import DEFAULT_BAUD, EMULATED, LoopsChoice
from flightstack.firmware.pil.session import RatedLink, negotiate_baud, restore_baud
from flightstack.firmware.targets import open_link, timing_of
from flightstack.firmware.toolchain.build import BuildError
from flightstack.transports.byte_link import ByteLink, LineError
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError
from gcs_cli.output import Output
from gcs_cli.pil.conformance import check
from gcs_cli.pil.conformance.run import conformance
from gcs_cli.pil.targets import port_or_target

_INDENT = " " * 34


def run_conformance(port: str | None, target: str | None, bauds: list[int] | None, as_json: bool) -> None:
    """Check a port against the contract of the firmware and print a line for each check; raise CliError."""
    if bauds is not None and len(bauds) > 1:
        raise CliError("--conformance: give one --baud", USAGE)
    choice = port_or_target(port, target)
    if bauds:
        choice = choice._replace(baud=bauds[0])
    output, failed, count = Output(as_json), list[str](), 0
    try:
        link = open_link(choice)
    except (BuildError, LineError) as error:
        raise CliError(str(error), USAGE) from None
    clock_s = None if choice.kind == EMULATED else time.monotonic
    with closing(link):
        try:
            _bring_to_rate(link, choice)
            for each in conformance(link, timing_of(choice).timeout_s, clock_s):
                count += 1
                failed += [each.name] * (each.result == check.FAILED)
                output.say("check", _sentence(each), **each._asdict())
            if count > 1 and isinstance(link, RatedLink) and choice.baud != DEFAULT_BAUD:
                restore_baud(link, timing_of(choice), time.monotonic)
        except BuildError as error:
            raise CliError(str(error), USAGE) from None
        except (OSError, TargetError) as error:
            raise CliError(str(error), NO_ANSWER) from None
    if failed:
        code = NO_ANSWER if count == 1 else FAILED
        raise CliError(f"the target does not conform: {', '.join(failed)}", code)


def _bring_to_rate(link: ByteLink, choice: LoopsChoice) -> None:
    """Bring a serial line and its target to the rate of ``choice``; raise CliError, TargetError."""
    if not isinstance(link, RatedLink):
        return
    if (note := negotiate_baud(link, choice.baud, timing_of(choice), time.monotonic)) is not None:
        raise CliError(f"{choice.device}: {note}", FAILED)


def _sentence(each: check.Check) -> str:
    first = f"{each.result:<11}  {each.name:<19}  {each.found}"
    return f"{first}\n{_INDENT}{each.advice}" if each.advice else first
