"""Noise on the wires of the whole stack, and the right answer after it."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from smbus2 import i2c_msg

from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.experiments.attitude import errors

UART_BYTES = 100_000
I2C_MESSAGES = 10_000
FRAMES = 300


def check_identification(client: Any) -> None:
    values = client.telemetry("Identification")
    expected = INTERFACE.telemetry("Identification").reset_values()
    assert values["InterfaceVersion"] == INTERFACE.version
    assert values.keys() == expected.keys()


def check_attitude(opened: Any) -> None:
    """From whatever state, a reset to power-up values leads to a right attitude."""
    client = opened.client.client
    client.wait_processed(60)
    for name in ("StopLoop", "ClearConfig", "Reset"):
        client.command(name)
        client.wait_processed(10)  # a reset forgets what waits behind it
    assert opened.client.capture_and_process().name == "CALCULATED"
    cross, roll = errors(opened.client.attitude().quaternion, opened.board.truth())
    assert cross < 0.01
    assert abs(roll) < 0.05


def let_it_answer(line: Any) -> None:
    """Read until the device has nothing more to say."""
    while line.read(4096, 0.2):
        pass


@pytest.fixture
def opened(session: Callable[..., Any]) -> Any:
    with session(SkyScene.pointing(84, -1), seed=4) as opened:
        yield opened


def test_random_bytes_on_the_uart(opened: Any, rng: np.random.Generator) -> None:
    line = opened.board.serial()
    line.write(rng.bytes(UART_BYTES))
    while opened.board.uart.host_backlog:
        line.read(4096, 0.01)
    check_identification(opened.client.client)
    check_attitude(opened)


def test_random_frames_on_the_uart(opened: Any, rng: np.random.Generator) -> None:
    line = opened.board.serial()
    for _ in range(FRAMES):
        known = INTERFACE.messages[rng.integers(len(INTERFACE.messages))]
        length = max(0, known.length + int(rng.integers(-1, 2)))
        line.write(encode_frame(bytes([known.id]) + rng.bytes(length)))
        line.read(4096, 0.05)
    let_it_answer(line)
    check_identification(opened.client.client)
    check_attitude(opened)


def test_random_messages_on_i2c(opened: Any, rng: np.random.Generator) -> None:
    bus = opened.board.i2c()
    for _ in range(I2C_MESSAGES):
        address = INTERFACE.i2c_address if rng.random() < 0.9 else int(rng.integers(8, 0x78))
        messages = []
        if rng.random() < 0.8:
            messages.append(i2c_msg.write(address, rng.bytes(int(rng.integers(0, 12)))))
        if rng.random() < 0.5 or not messages:
            messages.append(i2c_msg.read(address, int(rng.integers(1, 30))))
        with suppress(OSError):  # what the device does not acknowledge
            bus.i2c_rdwr(*messages)
    check_identification(I2cClient(bus, INTERFACE, wait=bus.wait))
    let_it_answer(opened.board.serial())  # a picture may be on its way down
    check_identification(opened.client.client)
    check_attitude(opened)
