"""Files of the process: logs, parameters, plans and signing key."""

from __future__ import annotations

from pathlib import Path

from flightstack.core.enums import Severity
from flightstack.firmware.targets import finish_loops
from flightstack.flight_log.flight_log import FlightLog
from flightstack.mavlink.signing import Signing
from flightstack.params.config import SYSTEM_ID, StackConfig
from flightstack.params.param_file import ParamFile
from flightstack.process.assembly import Stack, build
from flightstack.process.console import say
from flightstack.process.log_files import FileTail, LogFiles
from flightstack.process.log_library import LogLibrary
from flightstack.process.process_config import ProcessConfig, complain
from flightstack.process.signing_file import create_key, open_signing, replace_key
from flightstack.process.state_directory import PLANS_NAME, FileSaver, PlanFile
from flightstack.services.commands.context import PrepareReboot
from flightstack.services.logs.log_store import NO_LOGS


class ProcessFiles:
    """Connects the current stack to its files, and the next stack after a reboot."""

    def __init__(self, process: ProcessConfig, prepare_reboot: PrepareReboot) -> None:
        """``prepare_reboot`` is for each stack that is built."""
        self._process, self._prepare_reboot = process, prepare_reboot
        self._logs = LogFiles(process.log, process.overwrite_log)
        self._stack: Stack | None = None
        self._params: FileSaver | None = None
        self._plans = None if process.state is None else PlanFile(process.state / PLANS_NAME)
        self._signing: Signing | None = None

    def build(self, config: StackConfig) -> Stack:
        """Build a stack for ``adopt``; raise ConfigError, TargetError."""
        if self._params is not None:
            self._params.flush()  # the new stack reads the file
        log = self._process.log
        logs = NO_LOGS if log is None else LogLibrary(log.parent, self._own_log, self._open_tail)
        stack = build(config, self._open_log, logs, self._prepare_reboot)
        self._use_signing(stack)
        return stack

    def adopt(self, stack: Stack, config: StackConfig) -> None:
        """Connect ``stack``, built for ``config``, to the files."""
        self.close_parameters()
        is_first, self._stack = self._stack is None, stack
        if config.params_file is not None:
            self._params = _param_saver(stack, Path(config.params_file))
        stack.ground.vehicle.logs.logs()  # examine all logs now and not in flight
        if self._plans is not None and is_first:
            self._report(self._plans.restore(stack))

    def unsaved_parameters(self) -> str | None:
        """Return why the newest parameters are not saved, or None if they are."""
        return None if self._params is None else self._params.problem()

    def update(self) -> None:
        """Save changed plans; report each file that cannot be written once to ground stations and user."""
        assert self._stack is not None
        if self._plans is not None:
            self._plans.watch(self._stack)
            self._report(self._plans.take_error())
        if self._params is not None:
            self._report(self._params.take_error())
        error = self._stack.recorder.take_error()
        if error is not None:
            reason = error.strerror or str(error)
            self._report(f"the log {self._logs.current} ends early: {reason}", f"Logging stopped: {reason}")

    def _report(self, sentence: str | None, text: str | None = None) -> None:
        """Report a sentence to the user, and as ``text``, if given, to ground stations."""
        if sentence is None:
            return
        assert self._stack is not None
        self._stack.journal.say(Severity.CRITICAL, text or sentence[0].upper() + sentence[1:])
        complain(f"warning: {sentence}")

    def close_parameters(self) -> None:
        """Save changes; a second call does nothing."""
        if self._params is not None:
            self._params.close()

    def close_plans(self) -> None:
        """Save changes; a second call does nothing."""
        if self._plans is not None:
            self._plans.close()

    def close_loops(self) -> None:
        """Close the loops and write the record of a target's link beside the log."""
        if self._stack is None:
            return
        try:
            finish_loops(self._stack.loops, self._process.log)
        except OSError as error:
            complain(f"warning: the record of the target's link cannot be written: {error}")

    def close_signing(self) -> None:
        """Save the latest signing timestamp; nothing may be signed afterwards."""
        if self._signing is not None:
            self._signing.close()

    # ------------------------------------------------------------------ logs

    def _open_log(self) -> FlightLog | None:
        assert self._stack is not None
        try:
            return self._logs.open(len(self._stack.vehicle.rotors))
        except OSError as error:
            path = self._logs.current
            self._report(f"no log can be written to {path}: {error.strerror}")
            return None

    def _own_log(self) -> str | None:
        """Return the name of the current log, or None."""
        assert self._stack is not None
        path = self._logs.current
        return path.name if path is not None and self._stack.recorder.is_logging else None

    def _open_tail(self) -> FileTail | None:
        stack = self._stack
        assert stack is not None
        return self._logs.tail(lambda: stack.recorder.is_logging)

    # ------------------------------------------------------------------ signing

    def _use_signing(self, stack: Stack) -> None:
        """Sign the ground links if a key is configured; raise ConfigError.

        All stacks of the process share one ``Signing``, so that a frame received before a reboot is a replay after it.
        """
        path = self._process.signing_key
        if path is None:
            return
        if self._signing is None:
            if not path.exists():
                create_key(path)
                say(f"flightstack: new signing key written to {path}")
            role = f"vehicle-{self._process.ports.instance}"
            self._signing = open_signing(path, role, self._process.allow_unsigned)
        stack.ground.use_signing(self._signing, lambda key: replace_key(path, key))


def _param_saver(stack: Stack, path: Path) -> FileSaver:
    """Return the saver of a stack's parameters to ``path``."""
    file = ParamFile(path, int(stack.params.value(SYSTEM_ID)), stack.loaded_params)
    saver = FileSaver(lambda: file.save(stack.params), f"the parameters are not saved to {path}")
    stack.params.subscribe(lambda *_: saver.change())
    return saver
