"""The summary that ``gcs paper`` prints."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

_PLANTS = {
    "rigid_multibody": "rigid body against multibody",
    "paper_rigid": "small angles against rigid body",
}


def _chance(found: Mapping[str, Any]) -> str:
    """Return a remark where the loops amplify rounding, so that the difference is chance; else an empty string."""
    if found.get("bound_decides", True) or found["rounding"] is None:
        return ""
    alone_mm = 1e3 * found["rounding"]["max_position_m"]
    return f", by chance: a push of 10⁻¹² N moves it by {alone_mm:.3g} mm on one plant alone"


def print_results(console: Console, results: dict[str, Any], folder: Path) -> None:
    """Print the claims with their verdicts, the differences of the plants, missing parts and the output directory."""
    lines = []
    for claim in results["comparisons"]["claims"]:
        verdict = "holds" if claim["holds"] else "does not hold"
        lines += [f"{verdict:>13}: {claim['claim']} ({claim['source']})", f"{'':15}{claim['words']}"]
    for pair, contenders in results["plants"].items():
        for name, found in contenders.items():
            lines.append(
                f"{_PLANTS.get(pair, pair)}, {results['contenders'][name]['label']}: at most "
                f"{1e3 * found['max_position_m']:.3g} mm and {found['max_attitude_deg']:.3g}° apart{_chance(found)}"
            )
    lines += [f"left out: {part}: {why}" for part, why in results["left_out"].items()]
    lines.append(f"results in {folder}")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
