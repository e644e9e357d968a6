"""Recordings and traces at the pins of an emulated device; views into the user's own firmware."""

from __future__ import annotations

import errno
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.output import OutputFile, Outputs
from cubestack.host.recording.record_file import RecordFile
from cubestack.host.recording.setups import option_files

if TYPE_CHECKING:
    from cubestack.emulator.iss.insight.observer import Observer
    from cubestack.emulator.ports.gdb import GdbEndpoint
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.emulator.recording.trace import VcdTrace
    from cubestack.firmware_model.formats.recording import TextSink
    from cubestack.firmware_model.formats.setup import Setup


def start_recorder(emulated: AnyEmulated, stream: TextSink, setup: Setup | None = None) -> Recorder:
    """Record every byte of all ports, and actions from outside of them.

    Call it before any port opens.

    ``setup`` goes into the header, with the profile.
    """
    from cubestack.emulator.recording.recorder import Recorder

    board = emulated.board
    if setup is not None:
        options = {**setup.options, **emulated.chosen}
        named = {
            one.name: options[one.name]
            for one in emulated.device.all_options
            if one.is_file and options.get(one.name, "") not in ("", *one.known)
        }
        setup = replace(setup, options=options, files={**option_files(named), **setup.files})
    recorder = Recorder(stream, emulated.device.name, board.uarts, setup)
    recorder.listen(board.i2c_bus)
    emulated.on_act = lambda *what: recorder.control(board.kernel.now, *what)
    return recorder


def start_trace(emulated: AnyEmulated, stream: TextSink) -> VcdTrace:
    """Trace lines, buses, FPGA pins and firmware variables into a VCD file."""
    from cubestack.emulator.recording.trace import VcdTrace

    board = emulated.board
    trace = VcdTrace(
        stream,
        emulated.device.name,
        board.kernel,
        board.uarts,
        board.engine,
        board.probes,
        None if board.insight is None else board.insight.history,
    )
    trace.listen(board.i2c_bus)
    if board.pins is not None:
        for pin in board.pins:
            trace.declare(f"pins.{pin}", 1, board.pins.driven(pin))
        board.pins.listeners.append(
            lambda at_ps, pin, level: trace.put(at_ps, f"pins.{pin}", level)
        )
    return trace


def create_record(path: Path, files: Outputs, largest: int | None = None) -> RecordFile:
    """Open a file that grows for as long as the emulation runs, up to ``largest`` bytes.

    Raises ValueError if it cannot be written.
    """
    opened = files.create(path)
    file = RecordFile(opened, largest)

    def flush() -> None:
        file.flush()
        if file.stopped:
            raise OSError(errno.EIO, file.stopped)

    opened.before_kept = flush
    files.callback(file.flush)
    return file


@dataclass(frozen=True)
class InsightFiles:
    """Paths of the files to write; None for no file."""

    profile: Path | None = None
    coverage: Path | None = None

    def open(self, files: Outputs) -> Callable[[AnyEmulated], None]:
        """Open the files; ``files`` writes them for each device passed to the returned function.

        Raises ValueError for a file that cannot be written.
        """
        if self.profile is None and self.coverage is None:
            return lambda _emulated: None
        from cubestack.emulator.iss.insight.reports import write_callgrind, write_lcov

        by_program: dict[Any, list[Observer]] = defaultdict(list)
        outputs: list[tuple[OutputFile, Any]] = [
            (files.create(path), write)
            for path, write in ((self.profile, write_callgrind), (self.coverage, write_lcov))
            if path is not None
        ]

        def watch(emulated: AnyEmulated) -> None:
            observer = own_firmware(emulated, "--profile-out and --coverage-out").observer
            image = observer.machine.image
            observers = by_program[image.segments if image else ()]
            _merge(observers)  # each has counters of all memories
            observers.append(observer)

        def write_all() -> None:
            for observers in by_program.values():
                _merge(observers)
                for stream, write in outputs:
                    write(observers[0], stream)
                    stream.keep()  # even if the command ends with an error

        files.callback(write_all)
        return watch


def _merge(observers: list[Observer]) -> None:
    """Add those that have ended to the first one."""
    for other in observers[1:]:
        if observers[0].closed and other.closed:
            observers[0].add(other)
            observers.remove(other)


def own_firmware(emulated: AnyEmulated, what: str) -> Any:
    """The insight into a device's own firmware; raises ValueError if it runs none."""
    insight = emulated.board.insight
    if insight is None:
        name = emulated.device.name
        raise ValueError(f"{what}: {name} runs no own firmware; add --firmware")
    return insight


def open_gdb(emulated: AnyEmulated, port: int, *, wait: bool) -> GdbEndpoint:
    """Serve gdb for a device's own firmware on a local TCP port.

    Raises ValueError if it runs none, PortError if the port is not available.
    """
    from cubestack.emulator.boards.debugging import open_debugger

    own_firmware(emulated, "--gdb")
    board: Any = emulated.board
    endpoint = open_debugger(board, port, wait=wait)
    emulated.board.on_close.append(endpoint.close)
    return endpoint
