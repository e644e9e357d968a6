"""A serial line between two pseudo-terminals, with a node at its far end."""

import os
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cubestack.emulator.bus.line_format import LineFormat, LineSampler
from cubestack.emulator.ports.pseudo_terminal import line_format, read_settings
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.errors import PortClosedError
from cubestack.host.recording.transcript import transcript
from cubestack.host.shell.language import Shell
from cubestack.host.targets import open_target
from cubestack.host.transport.streams import SerialTransport

from ..conftest import UartLink
from .conftest import SOON_S

BAUD = 57600


@contextmanager
def cable(ours: Path, theirs: Path, uart: Any) -> Iterator[None]:
    """Connects two pseudo-terminals; the node at the far end uses its own baud rate only."""
    ends = [f"pty,raw,echo=0,link={end}" for end in (ours, theirs)]
    with subprocess.Popen(["socat", "-d", "-d", *ends], stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        assert any(b"data transfer loop" in line for line in process.stderr)
        far, near = SerialTransport(str(theirs), BAUD), os.open(ours, os.O_RDWR | os.O_NOCTTY)

        def serve() -> None:
            device = LineFormat(BAUD)
            with suppress(PortClosedError):
                while True:
                    asked = far.read(1000, SOON_S)
                    host = line_format(read_settings(near)) or device
                    uart.write(carried(asked, host, device))
                    far.write(carried(uart.read(1000, 0.0), device, host))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            process.terminate()
            process.wait()
            thread.join(SOON_S)
            os.close(near)
            far.close()


def carried(data: bytes, sender: LineFormat, receiver: LineFormat) -> bytes:
    """The bytes as sampled by the receiver; the bits of a pseudo-terminal have no length."""
    line = LineSampler(receiver)
    for index, byte in enumerate(data):
        line.put(byte, index * sender.character_ps, sender)
    end_ps = (len(data) + 2) * sender.character_ps
    return bytes(found.value for found in line.take(end_ps))


class RecordedNode:
    """Answers telemetry from a recording, in any order, and nothing else."""

    def __init__(self, path: Path, interface: Interface) -> None:
        self.interface = interface
        self.told = {
            one.name: one.values
            for one in transcript(load_recording(path), interface)
            if one.kind == MessageKind.TELEMETRY.value and not one.error
        }

    def answer(self, payload: bytes) -> bytes | None:
        message = self.interface.find(payload[0])
        if message is None or message.name not in self.told:
            return None
        return message.pack(**self.told[message.name])


def recorded_uart(device: str, folder: Path) -> UartLink:
    """A line with the recorded telemetry of a device."""
    path = folder / f"{device}.rec"
    target = open_target(f"emulated:{device}", record=path)
    Shell(target).execute("dump")
    target.close()
    return UartLink(RecordedNode(path, target.interface))
