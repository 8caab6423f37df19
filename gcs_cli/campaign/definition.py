"""Campaign files: a scenario, or the name of one, with the tables ``[campaign]`` and ``[vary]``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from flightstack.core.errors import ConfigError
from flightstack.params.toml_file import find_file, read_toml, set_value
from flightstack.params.vehicle import BUILT_IN, DEFAULT_VEHICLE, KIND
from flightstack.testing.scenario import Scenario, read_scenario
from flightstack.testing.toml_record import key, read_record
from gcs_cli.campaign.distributions import Distribution, Value, read_distribution

MONTE_CARLO, GRID, LATIN_HYPERCUBE, SOBOL = METHODS = ("monte-carlo", "grid", "latin-hypercube", "sobol")
MOST_FLIGHTS = 1_000_000
_FLAT = ("params", "simulated")
"""Tables whose keys may contain dots and brackets."""
_OWN = re.compile(r"[A-Za-z_]\w*")
_DEFAULT = Scenario()
"""A scenario without keys."""
_NOT_VARIED = {
    "expect": "what is expected is the same in each flight",
    "seed": "each flight has a seed of its own",
    "repeat": "give the number of flights",
    "campaign": "it is no part of the scenario",
}


@dataclass(frozen=True)
class Plan:
    """``[campaign]``."""

    method: str = key("monte-carlo", "how the inputs of the flights are selected", choices=METHODS)
    flights: int | None = key(None, "number of flights, 100 by default; of a grid, those at each point, 1 by default",
                              low=1, high=MOST_FLIGHTS)  # fmt: skip
    seed: int = key(1, "seed of the inputs and of the flights", low=0, high=2**31 - 1)
    scenario: str | None = key(
        None, "a scenario file beside this one, if this file has no `[expect]` of its own"
    )


@dataclass(frozen=True)
class Campaign:
    """A campaign as its file describes it."""

    path: Path
    plan: Plan
    vary: Mapping[str, Distribution]
    """Distribution of each input by its key."""
    scenario_path: Path
    values: Mapping[str, Any]
    """Content of the scenario, without the tables of the campaign."""

    @cached_property
    def texts(self) -> frozenset[str]:
        """Keys of the inputs that stand in braces in texts of the scenario."""
        return frozenset(name for name in self.vary if _OWN.fullmatch(name) and _has_text(self.values, name))

    def scenario(self, inputs: Mapping[str, Value]) -> Scenario:
        """Return the scenario with the inputs of one flight; raise ConfigError for a wrong type or range."""
        values: dict[str, Any] = deepcopy(dict(self.values))
        shown = {name: _shown(value) for name, value in inputs.items() if name in self.texts}
        if shown:
            values = _filled(values, shown)
        for name, value in inputs.items():
            if name not in self.texts:
                self._set(values, name, value)
        return read_scenario(self.scenario_path, values)

    def files(self, flights: Iterable[Mapping[str, Value]]) -> dict[str, bytes]:
        """Return the content of each file on which flights with these inputs depend, by name.

        Raise ConfigError, OSError.
        """
        paths = {self.path.resolve(), self.scenario_path.resolve()}
        seen = set()
        for inputs in flights:
            # a number names a file only as a part of a text
            texts = tuple(v for name, v in inputs.items() if isinstance(v, str) or name in self.texts)
            if texts not in seen:
                seen.add(texts)
                paths |= {path.resolve() for path in self.scenario(inputs).files()}
        found: dict[str, bytes] = {}
        for path in sorted(paths):
            found[path.name] = found.get(path.name, b"") + path.read_bytes()
        return found

    def nominal(self, name: str) -> float | None:
        """Return the number of an input without variation: that of ``nominal``, of the scenario or of the vehicle."""
        given = self.vary[name].nominal
        if given is not None or name in self.texts:
            return given
        table, _, rest = name.partition(".")
        if table == "simulated" and rest not in self.values.get(table, {}):
            vehicle = str(self.values.get("vehicle", DEFAULT_VEHICLE))
            file = str(self.scenario_path.parent / vehicle) if vehicle.endswith(".toml") else vehicle
            return _number(read_toml(find_file(file, BUILT_IN, KIND)).values(), _steps(rest))
        steps = [table, rest] if table in _FLAT else _steps(name)
        found = _number(self.values, steps)
        return _number(asdict(_DEFAULT), steps) if found is None else found

    def _set(self, values: dict[str, Any], name: str, value: Value) -> None:
        table, _, rest = name.partition(".")
        if table in _FLAT and rest:
            values.setdefault(table, {})[rest] = value
            return
        _add_defaults(values, _steps(name)[0])
        try:
            set_value(values, name, value)
        except KeyError as error:
            raise ConfigError(self.path, f"vary.{name}", error.args[0]) from None


def is_campaign(path: Path) -> bool:
    """Return True for a TOML file with a table ``[campaign]``."""
    try:
        return "campaign" in read_toml(path).values()
    except ConfigError:
        return False


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file; raise ConfigError, which names the key and what is allowed."""
    values = dict(read_toml(path).values())
    if "campaign" not in values:
        problem = "is a scenario: fly it with gcs test" if "expect" in values else "is no campaign"
        raise ConfigError(path, "", f"{problem}; a campaign has the tables [campaign] and [vary]")
    head, vary = values.pop("campaign"), values.pop("vary", None)
    if not isinstance(head, dict):
        raise ConfigError(path, "campaign", "must be a table")
    plan = read_record(Plan, path, head, "campaign")
    if not isinstance(vary, dict) or not vary:
        raise ConfigError(path, "vary", "is missing: name an input and its distribution")
    scenario_path = path
    if plan.scenario is not None:
        if values:
            problem = f"names a scenario, so that this file has no other keys, such as {next(iter(values))}"
            raise ConfigError(path, "campaign.scenario", problem)
        scenario_path = path.parent / plan.scenario
        values = dict(read_toml(scenario_path).values())
    if "expect" not in values:
        raise ConfigError(
            scenario_path, "expect", "is missing: each flight of a campaign is checked against it"
        )
    without_effect: dict[str, Any] = {name: values.pop(name) for name in ("seed", "repeat") if name in values}
    read_record(Scenario, scenario_path, without_effect, "")
    campaign = Campaign(path, plan, _distributions(path, vary), scenario_path, values)
    _check(campaign)
    return campaign


def _distributions(path: Path, vary: Mapping[str, Any]) -> dict[str, Distribution]:
    found = {}
    for name, entry in _entries(vary):
        try:
            found[name] = read_distribution(entry)
        except ValueError as error:
            raise ConfigError(path, f"vary.{name}", str(error)) from None
    return found


def _entries(table: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Return the distributions by key: ``wind.gust_m_s = {…}`` is a table in a table for TOML."""
    found: list[tuple[str, Any]] = []
    for name, entry in table.items():
        joined = f"{above}.{name}" if above else name
        if isinstance(entry, dict) and entry and all(isinstance(inner, dict) for inner in entry.values()):
            found += _entries(entry, joined)
        else:
            found.append((joined, entry if isinstance(entry, dict) else {}))
    return found


def _check(campaign: Campaign) -> None:
    """Raise ConfigError for inputs that a campaign cannot have, and for a scenario with an error."""
    for name, distribution in campaign.vary.items():
        where = f"vary.{name}"
        top = re.split(r"[.\[]", name)[0]
        if top in _NOT_VARIED:
            raise ConfigError(campaign.path, where, f"cannot be varied: {_NOT_VARIED[top]}")
        is_key = name in Scenario.__dataclass_fields__
        if _OWN.fullmatch(name) and not is_key and name not in campaign.texts:
            problem = f"is neither a key of the scenario nor in one of its texts as {{{name}}}"
            raise ConfigError(campaign.path, where, problem)
        if campaign.plan.method == GRID and not distribution.is_choice and distribution.steps is None:
            raise ConfigError(
                campaign.path, f"{where}.steps", "is missing: a grid needs the number of values"
            )
        if campaign.plan.method != GRID and distribution.steps is not None:
            raise ConfigError(campaign.path, f"{where}.steps", "is for a grid")
    flights = campaign.plan.flights
    if campaign.plan.method == SOBOL and flights is not None and flights & (flights - 1):
        near = 1 << (flights.bit_length() - 1)
        problem = f"{flights} is no power of 2, as sobol needs it: give {near} or {2 * near}"
        raise ConfigError(campaign.path, "campaign.flights", problem)


def _add_defaults(values: dict[str, Any], top: str) -> None:
    """Add the numbers of a list without a key, so that one of them can be set."""
    default = getattr(_DEFAULT, top, None)
    if isinstance(default, tuple):
        values.setdefault(top, list(default))
    elif top == "wind" and isinstance(wind := values.setdefault(top, {}), dict):
        wind.setdefault("mean_m_s", list(_DEFAULT.wind.mean_m_s))


def _steps(path: str) -> list[str]:
    return re.findall(r"[^.\[\]]+", path)


def _number(content: Any, steps: Sequence[str]) -> float | None:
    """Return the number at a path, or None."""
    for step in steps:
        try:
            content = content[int(step) if isinstance(content, list | tuple) else step]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return float(content) if isinstance(content, int | float) and not isinstance(content, bool) else None


def _has_text(value: Any, name: str) -> bool:
    if isinstance(value, str):
        return f"{{{name}}}" in value
    if isinstance(value, dict):
        return any(_has_text(entry, name) for key, entry in value.items() if key != "expect")
    return isinstance(value, list) and any(_has_text(entry, name) for entry in value)


def _filled(value: Any, shown: Mapping[str, str]) -> Any:
    """Return the content with the inputs in place of their names in braces."""
    if isinstance(value, str):
        for name, text in shown.items():
            value = value.replace(f"{{{name}}}", text)
        return value
    if isinstance(value, dict):
        return {name: entry if name == "expect" else _filled(entry, shown) for name, entry in value.items()}
    return [_filled(entry, shown) for entry in value] if isinstance(value, list) else value


def _shown(value: Value) -> str:
    """Return an input as a text of the scenario has it: the number that reads back as the same."""
    return repr(value) if isinstance(value, float) else str(value)
