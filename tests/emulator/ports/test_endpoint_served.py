"""The ports served by the scheduler in a thread, for pyserial and plain files."""

import contextlib
from pathlib import Path

import pytest
import serial

ALL_BYTES = bytes(range(256))
TIMEOUT_S = 20.0


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_pyserial_on_a_pty(pty, device, path, pace, served):
    device.echoes = True
    with served(device, pty, pace):
        for round_ in range(3):
            with serial.Serial(str(path), 57600, timeout=TIMEOUT_S, exclusive=True) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_pyserial_over_tcp(tcp, device, pace, served):
    device.echoes = True
    url = f"socket://{tcp.address[0]}:{tcp.address[1]}"
    with served(device, tcp, pace):
        for round_ in range(3):
            with serial.serial_for_url(url, timeout=TIMEOUT_S) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_plain_file_on_a_pty(pty, device, path, pace, terminal_at, served):
    device.echoes = True
    with served(device, pty, pace), contextlib.closing(terminal_at(path)) as terminal:
        terminal.write(ALL_BYTES)
        assert terminal.read(256) == ALL_BYTES


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_fast_pace_loses_nothing_to_a_client_slower_than_the_emulator(
    kind, request, device, terminal_at, connection_to, served
):
    """Virtual time waits for it: 400 kB come while it reads a few bytes at a time."""
    port = request.getfixturevalue(kind)
    sent = bytes(i * 37 % 251 for i in range(400_000))
    device.uart.on_byte = lambda _byte: device.uart.send(sent)
    with served(device, port, "fast"), contextlib.ExitStack() as stack:
        if kind == "pty":
            terminal = stack.enter_context(contextlib.closing(terminal_at(Path(port.name))))
            terminal.write(b"?")
            received = terminal.read(len(sent))
        else:
            client = stack.enter_context(contextlib.closing(connection_to(port.address)))
            client.socket.sendall(b"?")
            received = client.receive(len(sent))
    assert received == sent
