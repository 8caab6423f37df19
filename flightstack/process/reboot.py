"""A reboot of the vehicle in its process: everything begins anew, but nothing that was given to it is lost. No I/O."""

from __future__ import annotations

from dataclasses import replace

from flightstack.params.config import StackConfig
from flightstack.process.assembly import Stack


def config_after(stack: Stack, config: StackConfig) -> StackConfig:
    """Return the configuration to boot with: without a parameter file, the values of now are handed on."""
    if config.params_file is not None:
        return config
    changed = [name for name in stack.params.specs if not stack.params.is_default(name)]
    return replace(config, params=tuple(f"{name}={stack.params.value(name)!r}" for name in changed))


def carry_over(old: Stack, new: Stack) -> None:
    """Give the new stack what a reboot must not lose: peers, plans, home, and the newest state.

    What begins anew: the vehicle's clock, modes and failsafes, sequence numbers, transfers of files and missions,
    counters, timing. What the process keeps for all stacks: signing with the time stamps of its streams, the number
    of the next log, the parameter file.
    """
    for address, permanent in old.ground.addresses():
        new.ground.add_peer(address, permanent)
    new.area.set_home(old.area.home, old.places.home_is_chosen)
    new.ground.adopt_plans(old.ground)
    new.ground.last_heard_s = old.ground.last_heard_s
    new.simulator.resume(old.simulator)
    new.now.has_state = old.now.has_state
