"""Memory of the core's mixer, for tests that call it without the loops."""

from __future__ import annotations

import numpy as np

from flightstack.control.mixer import Mixer
from tests.firmware.core_support import Core


def mixer_of_c(c: Core, rotors: Mixer) -> np.ndarray:
    """Return memory of an fs_mixer with these numbers, and nothing derived yet."""
    flat, n = np.zeros(c.library.drive_sizes(3) // c.dtype.itemsize, c.dtype), rotors.spin.size
    numbers = flat[1:]  # after the number of rotors
    numbers[: 4 * n] = rotors.allocation.ravel()
    for axis in range(4):
        numbers[32 + 8 * axis : 32 + 8 * axis + n] = rotors.effectiveness[axis]
    for place, values in enumerate((rotors.low, rotors.high, rotors.spin)):
        numbers[64 + 8 * place : 64 + 8 * place + n] = values
    return flat
