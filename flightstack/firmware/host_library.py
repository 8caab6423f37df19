"""The loops in C inside this process: the functions of ``firmware/ports/host/fs_sil.h``."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE
from flightstack.firmware.sources import source_hash

_DOUBLES = ctypes.POINTER(ctypes.c_double)


class HostLoops:
    """One set of loops; implements ``c_loops.Computer``. A step allocates nothing."""

    def __init__(self, library: Path, numbers: Mapping[str, float]) -> None:
        """Load the library that ``build.host_library`` made and give its loops their numbers."""
        self._functions = functions = ctypes.CDLL(str(library))
        functions.fs_sil_size.restype = ctypes.c_uint32
        functions.fs_sil_get.restype = ctypes.c_double
        functions.fs_sil_get.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        functions.fs_sil_set.restype = ctypes.c_uint32
        functions.fs_sil_set.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_double]
        functions.fs_sil_init.restype = functions.fs_sil_step.restype = None
        functions.fs_sil_init.argtypes = [ctypes.c_void_p]
        functions.fs_sil_step.argtypes = [ctypes.c_void_p, _DOUBLES, ctypes.c_uint32, _DOUBLES]
        self._memory = (
            ctypes.c_double * (functions.fs_sil_size() // 8 + 1)
        )()  # doubles: aligned for all it holds
        self._loops = ctypes.cast(self._memory, ctypes.c_void_p)
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.zeros(OUTPUT_SIZE)
        self._step = functions.fs_sil_step
        self._in = self.input.ctypes.data_as(_DOUBLES)
        self._out = self.output.ctypes.data_as(_DOUBLES)
        functions.fs_sil_real_size.restype = ctypes.c_uint32
        real = "double" if functions.fs_sil_real_size() == 8 else "float"
        self.version = f"C, {real}, sources {source_hash().hex()}"
        functions.fs_sil_init(self._loops)
        for name, value in numbers.items():
            self.set(name, value)

    def step(self, flags: int) -> None:
        """Run one tick on ``input`` and write ``output``; ``flags`` as in FS_PIL_STEP."""
        self._step(self._loops, self._in, flags, self._out)

    def set(self, name: str, value: float) -> None:
        """Change a number; raise KeyError for a name that C has not, ValueError for a value it refuses."""
        result = self._functions.fs_sil_set(self._loops, name.encode(), value)
        if result == 2:
            raise KeyError(name)
        if result:
            raise ValueError(f"{name}={value:g} is out of range")

    def get(self, name: str) -> float:
        """Return a number as C has it; 0 for a name that it has not."""
        return float(self._functions.fs_sil_get(self._loops, name.encode()))

    def close(self) -> None:
        """End: the memory goes with the object."""
