"""Parameter store of one vehicle: declarations, values and change listeners."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

from flightstack.core.errors import ConfigError
from flightstack.params.spec import ParamSpec

Listener = Callable[[str, float], None]


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
        self._adopt(name, accepted, override)
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
        """Reset these parameters, or all, to their defaults; ignore unknown names."""
        for name in list(self.specs if names is None else names):
            spec = self.specs.get(name)
            if spec is not None:
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


def apply_assignments(store: ParamStore, assignments: Iterable[str]) -> None:
    """Override parameters by ``NAME=VALUE`` texts, in order; raise ConfigError."""
    for text in assignments:
        name, value = read_assignment(text)
        if name not in store.specs:
            near = difflib.get_close_matches(name, store.specs, n=1)
            hint = f"; did you mean {near[0]}?" if near else "; `gcs param list` shows them"
            raise ConfigError("--param", name, f"the vehicle has no such parameter{hint}")
        refusal = store.override(name, value)
        if refusal is not None:
            raise ConfigError("--param", text, refusal)
