"""Measurement of the link to a target at each baud rate, for ``gcs pil doctor``."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from flightstack.core.errors import TargetError
from flightstack.firmware.choice import DEFAULT_BAUD, SERIAL, LoopsChoice
from flightstack.firmware.pil.session import RatedLink, negotiate_baud, restore_baud
from flightstack.firmware.sources import source_hash
from flightstack.firmware.targets import open_link, timing_of
from flightstack.firmware.toolchain.build import BuildError
from flightstack.transports.byte_link import ByteLink, LineError
from gcs_cli.errors import FAILED, NO_ANSWER, USAGE, CliError
from gcs_cli.pil.advice import Port, advice
from gcs_cli.pil.probe import Measurement, measured
from gcs_cli.pil.target_record import status_words

BAUDS = (115_200, 230_400, 460_800, 921_600)
"""Rates of the F28377S port that its divider gives within half a percent."""


def examine(
    choice: LoopsChoice,
    bauds: Sequence[int],
    exchanges: int,
    progress: Callable[[int, int], None],
    clock_s: Callable[[], float] = time.monotonic,
) -> list[Measurement]:
    """Measure the link at each baud rate, or once if it is not serial; raise CliError if it cannot be opened.

    A serial target is at the rate of its start afterwards.
    """
    found: list[Measurement] = []
    for baud in bauds if choice.kind == SERIAL else (None,):
        tried = choice if baud is None else choice._replace(baud=baud)
        try:
            link = open_link(tried)
        except (BuildError, LineError) as error:
            raise CliError(str(error), USAGE) from None
        try:
            found.append(_measured(link, tried, exchanges, progress, clock_s))
        except (OSError, TargetError) as error:
            raise CliError(str(error), NO_ANSWER) from None
        finally:
            link.close()
    return found


def _measured(
    link: ByteLink,
    choice: LoopsChoice,
    exchanges: int,
    progress: Callable[[int, int], None],
    clock_s: Callable[[], float],
) -> Measurement:
    timing, baud = timing_of(choice), choice.baud if choice.kind == SERIAL else None
    note = negotiate_baud(link, choice.baud, timing, clock_s) if isinstance(link, RatedLink) else None
    if note is not None:
        return Measurement(baud, None, note)
    found = measured(link, baud, exchanges, progress, timing, clock_s)
    if isinstance(link, RatedLink) and found.problem is None and baud != DEFAULT_BAUD:
        restore_baud(link, timing, clock_s)
    return found


def port_of(choice: LoopsChoice) -> Port | None:
    """Return the port of a target and its latency timer; None without a port."""
    if choice.kind != SERIAL:
        return None
    path = Path("/sys/class/tty") / Path(choice.device).resolve().name / "device" / "latency_timer"
    try:
        return Port(choice.device, float(path.read_text()), str(path))
    except (OSError, ValueError):
        return Port(choice.device)


def findings(choice: LoopsChoice, found: Sequence[Measurement]) -> dict[str, Any]:
    """Return the measurements and the advice for JSON."""
    return {
        "target": choice.kind if choice.kind != SERIAL else choice.device,
        "sources_here": source_hash().hex(),
        "lines": [_line(each) for each in found],
        "advice": advice(port_of(choice), found, source_hash().hex()),
    }


def _line(each: Measurement) -> dict[str, Any]:
    median_s, p99_s = each.percentile_s(50.0), each.percentile_s(99.0)
    return {
        "baud": each.baud,
        "answers": each.identity is not None,
        "identity": each.identity,
        "problem": each.problem,
        "status_before": each.before,
        "exchanges": len(each.round_trips_s),
        "round_trip_median_ms": _ms(median_s),
        "round_trip_p99_ms": _ms(p99_s),
        "time_on_wire_ms": _ms(each.wire_s),
        "lost": each.lost,
        "bad": 0 if each.counters is None else each.counters.bad,
        "target_counted": each.troubles,
        "steps_per_s": None if each.steps_per_s is None else round(each.steps_per_s, 1),
    }


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds * 1e3, 4)


def print_findings(console: Console, result: dict[str, Any]) -> None:
    """Print the target's identity, a table of the rates, and the advice."""
    identity = next((line["identity"] for line in result["lines"] if line["identity"]), None)
    if identity is not None:
        words = f"{identity['board']}, {identity['compiler']}, sources {identity['source_hash']}"
        console.print(words, markup=False, highlight=False, soft_wrap=True)
        status = next((line["status_before"] for line in result["lines"] if line["answers"]), None)
        words = "its counters are unknown" if status is None else status_words(status)
        console.print(f"before the first step: {words}", markup=False, highlight=False, soft_wrap=True)
        table = Table(box=None, padding=(0, 2, 0, 0), header_style="bright_black")
        for name in ("baud", "round trip", "p99", "on the wire", "lost", "steps/s"):
            table.add_column(name, justify="right", no_wrap=True)
        for line in result["lines"]:
            table.add_row(*_cells(line))
        console.print(table)
    for sentence in result["advice"] or ("Nothing need be changed.",):
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)


def _cells(line: dict[str, Any]) -> tuple[str, ...]:
    baud = "–" if line["baud"] is None else str(line["baud"])
    if not line["answers"]:
        return baud, "no answer", "", "", "", ""
    times = (line[name] for name in ("round_trip_median_ms", "round_trip_p99_ms", "time_on_wire_ms"))
    shown = ("–" if value is None else f"{value:.3f} ms" for value in times)
    lost = f"{line['lost']} of {line['exchanges']}"
    return (baud, *shown, lost, "–" if line["steps_per_s"] is None else f"{line['steps_per_s']:.0f}")


def check_findings(result: dict[str, Any]) -> None:
    """Raise CliError if no target answered (no answer), or if none can fly (failed).

    One rate that works is enough: the advice covers the others.
    """
    lines = [line for line in result["lines"] if line["answers"]]
    if not lines:
        raise CliError(f"{result['target']}: no target answered", NO_ANSWER)
    fit = [line for line in lines if _is_ours(line["identity"], result["sources_here"])]
    if not fit:
        raise CliError(f"{result['target']}: the wrong firmware runs there", FAILED)
    if all(line["problem"] for line in fit):
        raise CliError(f"{result['target']}: the target {fit[0]['problem']}", NO_ANSWER)


def _is_ours(identity: dict[str, Any], sources_here: str) -> bool:
    return bool(identity["source_hash"] == sources_here and identity["real_octets"] == 4)
