"""Fly one case in this process."""

from __future__ import annotations

import hashlib
import time
import traceback

from flightstack.core.errors import ConfigError, TargetError
from flightstack.testing import Verdict, run_scenario
from flightstack.testing.events import describes
from flightstack.testing.flight import Flight
from gcs_cli.report.page import render_report
from gcs_cli.report.summary import RunInfo, summarise
from gcs_cli.scenarios.figures import figures_of, metrics_of
from gcs_cli.scenarios.result import Result, Wanted, not_flown
from gcs_cli.scenarios.selection import Case

_EXPECTED = (AssertionError, ConfigError, TargetError, OSError)
"""Errors of a flight whose text is enough; of any other the place is shown too."""
_LONGEST_TO_TEXT_S = 0.25
"""Largest time between an event and the text that describes it, with a slow outer loop too."""


def fly_case(case: Case, wanted: Wanted) -> Result:
    """Fly a case; an error of the flight is a failure."""
    began_s = time.perf_counter()
    try:
        verdict = run_scenario(case.scenario, case.seed)
        return _result(case, verdict, wanted, began_s)
    except _EXPECTED as error:
        return not_flown(f"{error}", time.perf_counter() - began_s)
    except Exception as error:  # a plug-in controller may raise anything
        trace = "".join(traceback.format_tb(error.__traceback__))
        reason = f"{type(error).__name__}: {error}\n{trace}".rstrip()
        return not_flown(reason, time.perf_counter() - began_s)


def _result(case: Case, verdict: Verdict, wanted: Wanted, began_s: float) -> Result:
    flight = verdict.flight
    content = flight.log.content
    has_files = wanted.every_file or (wanted.files and not verdict.passed)
    return Result(
        checks=verdict.checks,
        closest=verdict.closest,
        outcome=flight.outcome,
        outcome_text=flight.outcome_text,
        duration_s=flight.duration_s,
        wall_s=time.perf_counter() - began_s,
        log_sha256=hashlib.sha256(content).hexdigest() if content else None,
        texts=facts_of(flight),
        figures=figures_of(flight) if wanted.figures else (),
        metrics=metrics_of(flight) if wanted.metrics else {},
        log=content if has_files else b"",
        report=_report(case, verdict) if has_files else "",
    )


def facts_of(flight: Flight) -> tuple[tuple[float, str], ...]:
    """Return times and names of events and status texts; an event that a text describes is left out."""
    texts = [(round(text.time_s, 6), text.text) for text in flight.log.texts]
    events = [
        (round(event.time_s, 6), event.name)
        for event in flight.events
        if not any(
            abs(event.time_s - at_s) <= _LONGEST_TO_TEXT_S and describes(text, event.name)
            for at_s, text in texts
        )
    ]
    return tuple(sorted(events + texts, key=lambda fact: fact[0]))


def _report(case: Case, verdict: Verdict) -> str:
    """Return the report of a flight, as that of ``gcs fly``."""
    flight, setup = verdict.flight, verdict.flight.setup
    wind = ",".join(f"{speed:g}" for speed in setup.wind) if any(setup.wind) else None
    run = RunInfo(
        outcome=flight.outcome or "flown",
        outcome_text=flight.outcome_text,
        plan=case.label,
        vehicle=setup.vehicle,
        controller=setup.controller,
        gains=setup.gains,
        plant=setup.plant,
        loops=setup.loops,
        state=setup.state,
        seed=case.seed,
        wind=wind,
        gust=setup.gust or None,
        torque_gust=setup.torque_gust or None,
        ideal_rotors=setup.ideal_rotors,
        param=tuple(f"{name}={value:g}" for name, value in setup.params.items()),
    )
    summary = summarise(flight.data, flight.plan, run)
    summary["log_sha256"] = hashlib.sha256(flight.log.content).hexdigest()
    return render_report(flight.data, flight.plan, summary, [])
