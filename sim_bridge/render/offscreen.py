"""A place to render into without a screen: EGL, or OSMesa where EGL does not work.

The environment variable MUJOCO_GL (egl, osmesa, or disable), which all of MuJoCo's tools know, decides if it is set.
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
_ASKED = "MUJOCO_GL"
_PLATFORM = "PYOPENGL_PLATFORM"
_OFF = ("disable", "disabled", "off", "false", "0")
_ANY = ("", "enable", "enabled", "on", "true", "1", "glfw", "glx")
"""Values that leave us the choice: a window is no place for pictures that nobody is to see."""
_DEVICE_PLATFORM = 0x313F  # EGL_PLATFORM_DEVICE_EXT
_MOST_DEVICES = 16


def make_context(width: int, height: int) -> Any:
    """Return a current OpenGL context for pictures of this size; raise UsageProblemError without a renderer."""
    module = choose()
    try:
        context = import_module(module).GLContext(width, height)
        context.make_current()
    except Exception as error:  # whatever a driver or the bindings to it come up with
        raise UsageProblemError(f"{NO_RENDERER} ({module}: {_first_line(error)})") from None
    return context


def choose() -> str:
    """Return the module of MuJoCo that makes the context; raise UsageProblemError when none can.

    To be asked before MuJoCo is imported, which itself trips over a bad MUJOCO_GL.
    """
    asked = os.environ.get(_ASKED, "").lower().strip()
    if asked in _OFF:
        raise UsageProblemError(f"no off-screen renderer: {_ASKED}={asked} turns it off; unset it")
    if asked in ("egl", "osmesa"):
        return f"mujoco.{asked}"
    if asked not in _ANY:
        raise UsageProblemError(f"{_ASKED}={asked} is no renderer: set it to egl or osmesa, or unset it")
    if sys.platform == "darwin":
        return "mujoco.cgl"
    for name, works in (("egl", _egl_works), ("osmesa", _osmesa_is_there)):
        if os.environ.get(_PLATFORM, name) == name and works():
            return f"mujoco.{name}"
    raise UsageProblemError(NO_RENDERER)


def _osmesa_is_there() -> bool:
    return ctypes.util.find_library("OSMesa") is not None


def _egl_works() -> bool:
    """Ask EGL itself, as PyOpenGL cannot take another library once it has tried this one."""
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
