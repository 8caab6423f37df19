"""The top of the report: what came out, in figures and sentences. Pure."""

from __future__ import annotations

from html import escape

from gcs_cli.experiments.paper.report_findings import (
    Results,
    ended,
    onset_apart,
    paper_claims,
    same_bits,
    worst_plants,
)
from gcs_cli.experiments.paper.report_labels import anchored, fixed, number
from gcs_cli.experiments.paper.report_sentences import sentences
from gcs_cli.report.plots import section

_TELLING = 0.001


def tiles(results: Results) -> str:
    """Return the figures that stand on top."""
    found = [
        ("flights", str(len(results["cases"]))),
        ("crashed / lost control", f"{len(ended(results, 'crashed'))} / {len(ended(results, 'lost'))}"),
    ]
    claims = paper_claims(results)
    if claims:
        held = sum(all(claim["holds"] for claim in of) for of in claims.values())
        found.append(
            ("claims of the paper, made or implied, that hold on every plant", f"{held} of {len(claims)}")
        )
    worst = worst_plants(results)
    if worst is not None:
        found.append(
            (
                "rigid body to multibody, where loops are stable, at most",
                f"{_small(1e3 * worst[0])} mm, {_small(worst[1])}°",
            )
        )
    same = same_bits(results)
    if same is not None:
        found.append(("C core, here and on the target", "same bits" if same else "differs"))
    apart = onset_apart(results)
    if apart is not None:
        found.append(("onset of instability, simulated and predicted", f"≤ {fixed(apart, 2)} % apart"))
    cells = "".join(
        f'<div class="tile"><b>{escape(value)}</b><span>{escape(name)}</span></div>' for name, value in found
    )
    return f'<div class="tiles">{cells}</div>'


def _small(value: float) -> str:
    """Write a difference with two digits; of one that nobody could measure it is enough to say so."""
    return f"< {_TELLING:g}" if value < _TELLING else number(value, 2)


def summary_section(results: Results) -> str:
    """Return what came out, in sentences."""
    items = "".join(f"<li>{sentence}</li>" for sentence in sentences(results))
    return anchored("summary", section("What came out", f'<ul class="summary">{items}</ul>'))
