"""Parameter store of one vehicle: declarations, values and change listeners."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import TypeVar

from flightstack.core.errors import ConfigError, plain
from flightstack.params.spec import ParamSpec

Listener = Callable[[str, float], None]
Item = TypeVar("Item")


class ParamStore:
    """Values of all declared parameters, each valid by its declaration."""

    def __init__(self, specs: Iterable[ParamSpec]) -> None:
        """Set every parameter to its default; raise ValueError for a name declared twice."""
        ordered = sorted(specs, key=lambda spec: spec.name)
        self.specs: Mapping[str, ParamSpec] = MappingProxyType({spec.name: spec for spec in ordered})
        """Declarations by name, in the order of MAVLink's parameter indices."""
        if len(self.specs) != len(ordered):
            raise ValueError("a parameter is declared twice")
        self._values = {spec.name: spec.number(spec.default) for spec in ordered}
        self._pairs = [(spec.at_least, spec.name) for spec in ordered if spec.at_least]
        self._overridden: set[str] = set()
        self._listeners: list[Listener] = []

    def value(self, name: str) -> float:
        """Return the value, an ``int`` for an integer parameter; raise KeyError for an unknown name."""
        return self._values[name]

    def values(self) -> dict[str, float]:
        """Return all values by name, in the order of the names."""
        return dict(self._values)

    def set(self, name: str, value: float) -> str | None:
        """Set a parameter; return the reason for a refusal, or None."""
        return self._set(name, value, override=False)

    def override(self, name: str, value: float) -> str | None:
        """Set a parameter for this run only: it is not saved until it is set or reset."""
        return self._set(name, value, override=True)

    def _set(self, name: str, value: float, override: bool) -> str | None:
        spec = self.specs.get(name)
        if spec is None:
            return "there is no such parameter"
        accepted = spec.accepted(value)
        if isinstance(accepted, str):
            return accepted
        refusal = self._crossing(name, accepted)
        if refusal is not None:
            return refusal
        self._adopt(name, accepted, override)
        return None

    def _crossing(self, name: str, value: float) -> str | None:
        """Return why a value does not fit the other parameter of a pair, or None."""
        for least, largest in self._pairs:
            if name == least and value > self._values[largest]:
                return f"{plain(value)} is above {largest}, which is {plain(self._values[largest])}"
            if name == largest and value < self._values[least]:
                return f"{plain(value)} is below {least}, which is {plain(self._values[least])}"
        return None

    def _adopt(self, name: str, value: float, override: bool) -> None:
        has_changed = value != self._values[name] or (name in self._overridden and not override)
        self._values[name] = value
        if override:
            self._overridden.add(name)
        else:
            self._overridden.discard(name)
        if has_changed:
            for listener in self._listeners:
                listener(name, value)

    def reset(self, names: Iterable[str] | None = None) -> None:
        """Reset these parameters, or all, to their defaults; ignore unknown names.

        If a default does not fit the other parameter of a pair, both are reset.
        """
        chosen = [name for name in (self.specs if names is None else names) if name in self.specs]
        after = self._values | {name: self.specs[name].default for name in chosen}
        for least, largest in self._pairs:
            if after[least] > after[largest]:
                chosen += [name for name in (least, largest) if name not in chosen]
            first = least if self.specs[largest].default < self._values[least] else largest
            chosen.sort(key=lambda name, first=first: name != first)  # type: ignore[misc]
        for name in chosen:
            spec = self.specs[name]
            self._adopt(name, spec.number(spec.default), override=False)

    def is_default(self, name: str) -> bool:
        """Return True if a parameter has its default value."""
        return self._values[name] == self.specs[name].default

    def is_overridden(self, name: str) -> bool:
        """Return True if the value was set by ``override`` and is not saved."""
        return name in self._overridden

    def subscribe(self, listener: Listener) -> None:
        """Call ``listener(name, value)`` at every change."""
        self._listeners.append(listener)


def read_assignment(text: str) -> tuple[str, float]:
    """Read ``NAME=VALUE``, the name in any case; raise ConfigError."""
    name, separator, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        separator = ""
    if not separator or not name.strip():
        raise ConfigError("--param", text, "must be NAME=VALUE with a number")
    return name.strip().upper(), number


def set_all(items: Iterable[Item], set_one: Callable[[Item], str | None]) -> tuple[Item, str] | None:
    """Set items in order, and refused ones again at the end, when the other parameter of a pair may fit them.

    Return the first that is refused again, with the reason, or None.
    """
    refused = [item for item in items if set_one(item) is not None]
    again = ((item, set_one(item)) for item in refused)
    return next(((item, reason) for item, reason in again if reason is not None), None)


def apply_assignments(store: ParamStore, assignments: Iterable[str]) -> None:
    """Override parameters by ``NAME=VALUE`` texts, in order; raise ConfigError."""
    given = []
    for text in assignments:
        name, value = read_assignment(text)
        if name not in store.specs:
            near = difflib.get_close_matches(name, store.specs, n=1)
            hint = f"; did you mean {near[0]}?" if near else "; `gcs param list` shows them"
            raise ConfigError("--param", name, f"the vehicle has no such parameter{hint}")
        given.append((text, name, value))
    refused = set_all(given, lambda item: store.override(item[1], item[2]))
    if refused is not None:
        raise ConfigError("--param", refused[0][0], refused[1])
