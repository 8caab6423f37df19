"""Off-screen OpenGL context: EGL, or OSMesa if EGL does not work.

The environment variable MUJOCO_GL of MuJoCo (egl, osmesa, or disable) takes precedence.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from importlib import import_module
from typing import Any

from sim_bridge.errors import UsageProblemError

NO_RENDERER = "no off-screen renderer: install EGL (libegl1 and a driver) or OSMesa (libosmesa6)"
_VARIABLE = "MUJOCO_GL"
_PLATFORM = "PYOPENGL_PLATFORM"
_OFF = ("disable", "disabled", "off", "false", "0")
_ANY = ("", "enable", "enabled", "on", "true", "1", "glfw", "glx")
"""Values that leave the choice to this module; windows are not used off screen."""
_DEVICE_PLATFORM = 0x313F  # EGL_PLATFORM_DEVICE_EXT
_MOST_DEVICES = 16


def make_context(width: int, height: int) -> Any:
    """Return a current OpenGL context for pictures of this size; raise UsageProblemError without a renderer."""
    module = choose_backend()
    try:
        context = import_module(module).GLContext(width, height)
        context.make_current()
    except Exception as error:  # any error of a driver or its bindings
        raise UsageProblemError(f"{NO_RENDERER} ({module}: {_first_line(error)})") from None
    return context


def choose_backend() -> str:
    """Return the MuJoCo module that creates the context; raise UsageProblemError if none works.

    Call it before the import of MuJoCo, which fails on an invalid MUJOCO_GL.
    """
    value = os.environ.get(_VARIABLE, "").lower().strip()
    if value in _OFF:
        raise UsageProblemError(f"no off-screen renderer: {_VARIABLE}={value} turns it off; unset it")
    if value in ("egl", "osmesa"):
        return f"mujoco.{value}"
    if value not in _ANY:
        raise UsageProblemError(
            f"{_VARIABLE}={value} is not a renderer; set it to egl or osmesa, or unset it"
        )
    if sys.platform == "darwin":
        return "mujoco.cgl"
    for name, works in (("egl", _egl_works), ("osmesa", _has_osmesa)):
        if os.environ.get(_PLATFORM, name) == name and works():
            return f"mujoco.{name}"
    raise UsageProblemError(NO_RENDERER)


def _has_osmesa() -> bool:
    return ctypes.util.find_library("OSMesa") is not None


def _egl_works() -> bool:
    """Query EGL directly: PyOpenGL cannot switch to another library after a failure."""
    name = ctypes.util.find_library("EGL")
    if name is None:
        return False
    try:
        egl = ctypes.CDLL(name)
        look_up = egl.eglGetProcAddress
        look_up.restype, look_up.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        query, display_of = look_up(b"eglQueryDevicesEXT"), look_up(b"eglGetPlatformDisplayEXT")
        if not query or not display_of:
            return False
        pointer, integer = ctypes.c_void_p, ctypes.c_int
        query_devices = ctypes.CFUNCTYPE(integer, integer, pointer, pointer)(query)
        platform_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display_of)
        egl.eglInitialize.argtypes = [pointer, pointer, pointer]
        devices, count = (pointer * _MOST_DEVICES)(), integer(0)
        if not query_devices(_MOST_DEVICES, devices, ctypes.addressof(count)):
            return False
        displays = (platform_display(_DEVICE_PLATFORM, devices[i], None) for i in range(count.value))
        return any(display and egl.eglInitialize(display, None, None) for display in displays)
    except (OSError, AttributeError):
        return False


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
