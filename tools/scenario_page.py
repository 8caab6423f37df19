"""The page of the scenario files, and their JSON schema, from the declarations in ``flightstack.testing``."""

from __future__ import annotations

import json
from collections.abc import Iterable

from flightstack.commander.failsafe import Failsafe
from flightstack.core.enums import Mode
from flightstack.testing.events import EVENTS
from flightstack.testing.expression import SIGNALS
from flightstack.testing.faults import DIRECTIONS, LINK_FAULTS
from flightstack.testing.orders import ORDERS
from flightstack.testing.scenario import ClientKey, Event, Expect, Scenario, Wind
from flightstack.testing.toml_record import json_schema, key_rows
from gcs_cli.campaign.definition import Plan
from gcs_cli.report.flight_outcome import Code
from tools.generated import ROOT

SCENARIOS_HEAD = """\
# Scenario files

{note}

A scenario is a TOML file with a table `[expect]`: a plan, the vehicle and its conditions, events, and what is expected
of the flight. [`gcs test`](cli-gcs.md#gcs-test) flies it. An unknown key, a wrong type and a value outside its range
are errors before the flight. Editors check a file against [scenario.schema.json](scenario.schema.json) if its first
line is `#:schema` and the path of that file. Examples: `missions/*.toml`.

```toml
--8<-- example
```
"""
SCENARIOS_EXAMPLE = "missions/lost_ground_station.toml"
TABLES = (
    ("Top level", Scenario, "A plan, or `duration_s` or `limit_s`, is required."),
    ("`[wind]`", Wind, "Wind acts on a vehicle with drag: set `drag`, or use one that has it."),
    ("`[[client]]`", ClientKey, "The ground station `gcs` is always there."),
    (
        "`[[event]]`",
        Event,
        "An event has one trigger and one effect. It happens once. An event that does not happen is a failure, and so "
        "is a refused request without `refused`.",
    ),
    ("`[expect]`", Expect, ""),
)
CAMPAIGN = """
A file with this table and `[vary]` is a campaign: [`gcs campaign`](../how-to/campaigns.md) flies it, not `gcs test`.
`seed` and `repeat` of the scenario have no effect there.
"""
VARY = """
Each entry of `[vary]` is an input and its distribution:

| distribution | values |
| --- | --- |
| `{ uniform = [LOW, HIGH] }` | numbers of a range |
| `{ log_uniform = [LOW, HIGH] }` | numbers whose logarithm is uniform |
| `{ normal = [MEAN, DEVIATION] }` | normally distributed numbers, cut off at `low` and `high` if they are given |
| `{ choice = [A, B, …] }` | one of these numbers, texts or flags |

`steps` is the number of values in a grid: both ends of a range and what lies evenly between them. `nominal` is the
value without variation, from which `--seek worst` counts.
"""
EXPRESSIONS = """
Expressions compare signals with numbers and modes: `<`, `<=`, `>`, `>=`, `==`, `!=`, `and`, `or`, `not`, `+ - * /`,
and the functions `abs`, `sqrt`, `hypot`, `min`, `max`. In `always` and `eventually`, `after EVENT` and
`within 20 s of EVENT` at the end restrict the time.

The *margin* of an expectation is how far the flight was from violating it, in the unit of the compared values: for
`altitude_m < 12` with a largest height of 11 m it is 1 m. `gcs test` shows the margin that is the smallest share of its
limit.
"""


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ("---",) * len(head), *rows]
    return "\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def scenarios_page(note: str) -> str:
    """Return the page of the scenario files; ``note`` says what makes it."""
    example = (ROOT / SCENARIOS_EXAMPLE).read_text(encoding="utf-8").rstrip()
    parts = [SCENARIOS_HEAD.format(note=note).replace("--8<-- example", example)]
    for title, kind, text in TABLES:
        rows = [
            (f"`{name}`", value, meaning, f"`{default}`" if default else "")
            for name, value, meaning, default in key_rows(kind)
        ]
        parts += [
            f"\n## {title}\n",
            f"\n{text}\n" if text else "",
            table(("key", "value", "meaning", "default"), rows),
        ]
    for kind, names in (("code", Code), ("mode", Mode.__members__), ("failsafe", Failsafe.__members__)):
        parts.append(f"\n`outcome` as a {kind}: {', '.join(f'`{name}`' for name in names)}.\n")
    parts.append("\nWithout `outcome` a plan is expected to be completed.\n")
    rows = [
        (f"`{name}`", value, meaning, f"`{default}`" if default else "")
        for name, value, meaning, default in key_rows(Plan)
    ]
    parts += ["\n## `[campaign]`\n", CAMPAIGN, table(("key", "value", "meaning", "default"), rows), VARY]
    parts += ["\n## Signals\n", EXPRESSIONS, table(("signal", "meaning"), rows_of(SIGNALS.items()))]
    events = ((f"`{event.form}`", event.meaning, "yes" if event.is_live else "") for event in EVENTS)
    parts.append(
        "\n## Event names\n\nFor `after` in an expression; `after` of an event knows the marked ones.\n"
    )
    parts.append(table(("event", "meaning", "in flight"), events))
    forms = [*(order.form for order in ORDERS.values()), "hold", "mode NAME"]
    parts.append(f"\n## Commands\n\n{', '.join(f'`{form}`' for form in forms)}.\n")
    directions = " or ".join(f"`{name}`" for name in DIRECTIONS)
    parts.append(f"\n## Links\n\n{directions} before a change restricts it to one direction.\n")
    changes = (
        (
            f"`{word}{' VALUE' if fault.largest else ''}`",
            fault.meaning,
            f"0 to {fault.largest:g}" if fault.largest else "",
        )
        for word, fault in LINK_FAULTS.items()
    )
    parts.append(table(("change", "meaning", "value"), changes))
    return "".join(parts)


def rows_of(pairs: Iterable[tuple[str, str]]) -> Iterable[tuple[str, ...]]:
    """Return rows with names as code."""
    return ((f"`{name}`", meaning) for name, meaning in pairs)


def schema_text() -> str:
    """Return the JSON schema of the scenario files."""
    return json.dumps(json_schema(Scenario, "flightstack scenario"), indent=1, ensure_ascii=False) + "\n"
