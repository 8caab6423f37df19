"""How to install what only some commands need: the packages of the extras in ``pyproject.toml``, by their own names.

``pip install 'flightstack[…]'`` works for a release on PyPI alone, these commands in any environment.
"""

INSTALL_MULTIBODY = "pip install mujoco pillow imageio-ffmpeg"
INSTALL_FIRMWARE = "pip install ziglang unicorn"
