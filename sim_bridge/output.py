"""Output of ``sim-bridge``."""

from __future__ import annotations

import typer

from flightstack.process import console


def say(text: object) -> None:
    """Print a line for the user."""
    console.say(f"sim-bridge: {text}")


def complain(text: object) -> None:
    """Print a warning or an error."""
    console.complain(f"sim-bridge: {text}")


def print_result(text: str) -> None:
    """Print the result of a command; raise typer.Exit if it cannot be written."""
    error = console.say(text)
    if error is None:
        return
    if not isinstance(error, BrokenPipeError):  # the reader closed the pipe, which is no error
        complain(f"cannot write the result: {getattr(error, 'strerror', None) or error}")
    raise typer.Exit(1)
