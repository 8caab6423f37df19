"""Dead time of rotor commands: a queue for each delayed rotor, one command for each integration step."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray


class DeadTime:
    """Delays the commands of single rotors by whole integration steps."""

    def __init__(self) -> None:
        self._delays_s: dict[int, float] = {}
        self._waiting: dict[int, deque[float]] = {}
        self._step_s = 1.0
        self._command: FloatArray = np.zeros(MAX_ROTORS)

    @property
    def is_active(self) -> bool:
        """True if a rotor is delayed."""
        return bool(self._delays_s)

    def set_step(self, step_s: float) -> None:
        """Set the integration step [s]; commands that wait keep their order."""
        self._step_s = step_s
        for rotor, delay_s in self._delays_s.items():
            self._fill(rotor, delay_s, self._waiting[rotor][0])

    def set_delay(self, rotor: int, delay_s: float, held_rad_s: float) -> None:
        """Set the dead time of a rotor [s], 0 for none; ``held_rad_s`` is commanded until the first command is due."""
        if delay_s == self._delays_s.get(rotor, 0.0):
            return
        if delay_s == 0.0:
            del self._delays_s[rotor], self._waiting[rotor]
            return
        self._delays_s[rotor] = delay_s
        self._waiting.setdefault(rotor, deque())
        self._fill(rotor, delay_s, held_rad_s)

    def _fill(self, rotor: int, delay_s: float, held_rad_s: float) -> None:
        """Give a queue its length: the oldest commands go, or ``held_rad_s`` comes before them."""
        waiting, count = self._waiting[rotor], math.ceil(delay_s / self._step_s - 1e-9)
        while len(waiting) > count:
            waiting.popleft()
        waiting.extendleft([held_rad_s] * (count - len(waiting)))

    def delayed(self, command_rad_s: FloatArray) -> FloatArray:
        """Take the commands of one step, shape (8,); return those that act in it, valid until the next call."""
        out = self._command
        out[:] = command_rad_s
        for rotor, waiting in self._waiting.items():
            waiting.append(out.item(rotor))
            out[rotor] = waiting.popleft()
        return out
