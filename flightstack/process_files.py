"""The files of one process: the logs, the parameters and the signing key that its stacks use."""

from __future__ import annotations

from pathlib import Path

from flightstack.assembly import Stack, build
from flightstack.config import StackConfig
from flightstack.firmware.targets import finish_loops
from flightstack.logging.flight_log import FlightLog
from flightstack.logging.log_files import LogFiles
from flightstack.logging.log_library import LogLibrary
from flightstack.logging.log_tail import FileTail
from flightstack.mavlink.services.log_store import NO_LOGS
from flightstack.mavlink.signing import Signing
from flightstack.params.identity import SYSTEM_ID
from flightstack.params.saver import ParamSaver
from flightstack.process_config import ProcessConfig, complain
from flightstack.signing_file import create_key, open_signing, replace_key
from flightstack.snapshot import ERROR


class ProcessFiles:
    """Joins a stack to its files; a reboot joins the next one."""

    def __init__(self, process: ProcessConfig) -> None:
        self._process = process
        self._logs = LogFiles(process.log)
        self._stack: Stack | None = None
        self._saver: ParamSaver | None = None
        self._signing: Signing | None = None

    def build(self, config: StackConfig) -> Stack:
        """Build a stack, which ``adopt`` puts in place of the present one; raise ConfigError, TargetError."""
        if self._saver is not None:
            self._saver.flush()  # the new stack reads the file
        log = self._process.log
        stack = build(config, self._open_log, NO_LOGS if log is None else LogLibrary(log.parent))
        stack.ground.vehicle.open_log_tail = self._open_tail
        self._use_signing(stack)
        return stack

    def adopt(self, stack: Stack, config: StackConfig) -> None:
        """Join ``stack``, built for ``config``, to the files."""
        self.close_parameters()
        self._stack = stack
        if config.params_file is not None:
            system_id = int(stack.params.value(SYSTEM_ID))
            self._saver = ParamSaver(stack.params, stack.loaded_params, Path(config.params_file), system_id)

    def take_problem(self) -> str | None:
        """Return the sentence why parameters were not saved, once for each time."""
        return None if self._saver is None else self._saver.take_error()

    def close_parameters(self) -> None:
        """Save what has changed; a second call does nothing."""
        if self._saver is not None:
            self._saver.close()

    def close_loops(self) -> None:
        """End the loops; those of a target leave the record of their link beside the log."""
        if self._stack is None:
            return
        try:
            finish_loops(self._stack.loops, self._process.log)
        except OSError as error:
            complain(f"the record of the target's link cannot be written: {error}")

    def close_signing(self) -> None:
        """Keep the time of the newest signature, and end; nothing is signed after it."""
        if self._signing is not None:
            self._signing.close()

    # ------------------------------------------------------------------ logs

    def _open_log(self) -> FlightLog | None:
        assert self._stack is not None
        try:
            return self._logs.open(len(self._stack.vehicle.rotors))
        except OSError as error:
            path = self._logs.current
            self._stack.autopilot.say(ERROR, f"No log: {path}: {error.strerror}")
            complain(f"no log can be written to {path}: {error.strerror}")
            return None

    def _open_tail(self) -> FileTail | None:
        stack = self._stack
        assert stack is not None
        return self._logs.tail(lambda: stack.recorder.is_logging)

    # ------------------------------------------------------------------ signing

    def _use_signing(self, stack: Stack) -> None:
        """Sign the ground links if there is to be a key; raise ConfigError.

        All stacks of the process share one ``Signing``: a frame heard before a reboot is a replay after it.
        """
        path = self._process.signing_key
        if path is None:
            return
        if self._signing is None:
            if not path.exists():
                create_key(path)
                print(f"flightstack: a new signing key is in {path}", flush=True)
            role = f"vehicle-{self._process.ports.instance}"
            self._signing = open_signing(path, role, self._process.allow_unsigned)
        stack.ground.use_signing(self._signing, lambda key: replace_key(path, key))
