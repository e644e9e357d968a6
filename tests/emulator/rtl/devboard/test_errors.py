"""Each way in which a board fails is one line, soon."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.devboard.board import engine_on, open_board
from cubestack.emulator.rtl.devboard.channel import DevboardError, SerialChannel
from cubestack.emulator.rtl.devboard.link import Link
from cubestack.emulator.rtl.factory import make_engine
from cubestack.firmware_model.interface.devboard import BoardAddress, parse_address
from cubestack.firmware_model.interface.devboard.table import BAUD
from cubestack.hdl.cubestar.top import CubeStarTop

from ..cameras import plain_camera
from .boards import DirectChannel, behind_pty, model

BOARD = cubestar_wiring(CubeStarTop(8, 4))


class Answers(DirectChannel):
    """Answers each write by ``reply``; knows one baud rate."""

    def __init__(self, reply: Callable[[bytes], bytes], rate: int | None = None) -> None:
        super().__init__(model(BOARD))
        self._reply, self._rate, self._now = reply, rate, BAUD

    def write(self, data: bytes) -> None:
        self._answers += self._reply(data) if self._rate != self._now else self.board.receive(data)

    def set_baud(self, baud: int) -> bool:
        self._now = baud
        return self._rate is not None


@pytest.mark.parametrize(
    ("channel", "text"),
    [
        (
            Answers(lambda _data: b""),
            "does not answer; check power and port, and write the bitstream",
        ),
        (Answers(lambda _data: b"login: "), "sent 28 bytes that are no answer; another program or"),
        (
            Answers(lambda _data: b"\x81\x03", 1_000_000),
            "answers at 1000000 baud, not at 3000000; add @1",
        ),
    ],
)
def test_board_that_does_not_answer_says_why(channel: Answers, text: str) -> None:
    with pytest.raises(DevboardError, match=text):
        engine_on(channel, BAUD, BOARD)
    assert not channel.connected


def test_other_version_of_the_protocol_is_named() -> None:
    channel = DirectChannel(model(BOARD))
    channel.board.identity = replace(channel.board.identity, version=9)
    with pytest.raises(DevboardError, match="protocol of the board has version 9, this"):
        engine_on(channel, BAUD, BOARD)


def test_other_design_names_both() -> None:
    with pytest.raises(
        DevboardError, match=r"has the top small \(design .*needs CubeStarTop \(desi"
    ):
        engine_on(DirectChannel(model(BOARD, "small")), BAUD, cubestar_wiring())


def test_board_that_loses_its_power_is_noticed() -> None:
    channel = DirectChannel(model(BOARD))
    engine = engine_on(channel, BAUD, BOARD)
    channel.board = model(BOARD)
    with pytest.raises(DevboardError, match="was restarted in the middle; its state is lost"):
        engine.set_pin("ENABLE", 1)


def test_board_that_hangs_is_given_up() -> None:
    channel = DirectChannel(model(BOARD))
    engine = engine_on(channel, BAUD, BOARD)
    channel.damage = lambda _data: b""
    with pytest.raises(DevboardError, match="has not answered for 10 s: it hangs, or the cable is"):
        engine.set_pin("ENABLE", 1)


def test_board_that_rejects_a_request_is_named() -> None:
    channel = DirectChannel(model(BOARD))
    link = Link(channel)
    link.open(BAUD)
    response = link.request(7)  # type: ignore[arg-type]
    assert response.status.name == "REJECTED"


@pytest.fixture
def served() -> Any:
    """A board behind a pseudo-terminal."""
    with behind_pty(model(BOARD).receive) as path:
        yield path


def test_engine_runs_behind_a_pseudo_terminal(served: str) -> None:
    engine = make_engine(BOARD, f"board:{served}")
    camera = plain_camera(8, 4, 1)
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    engine.run(camera.end_ps, ("ACK", 1))
    assert engine.get_pin("ACK") == 1
    assert (engine.sram[:31] == camera.images[0].ravel()[:31]).all()
    engine.close()


def test_port_in_use_and_missing_ports_are_named(served: str, tmp_path: Path) -> None:
    engine = open_board(BOARD, BoardAddress((served,)))
    with pytest.raises(DevboardError, match=f"{served} is in use by another program"):
        open_board(BOARD, BoardAddress((served,)))
    engine.close()
    with pytest.raises(DevboardError, match="there is no port /dev/none; serial ports: "):
        open_board(BOARD, BoardAddress(("/dev/none",)))
    (tmp_path / "file").write_text("")
    with pytest.raises(DevboardError, match=r"file can not be opened: Could not configure port"):
        open_board(BOARD, BoardAddress((str(tmp_path / "file"),)))
    with pytest.raises(DevboardError, match="nothing listens on socket://localhost:1"):
        open_board(BOARD, BoardAddress(("socket://localhost:1",)))
    with pytest.raises(DevboardError, match="CubeStarTop runs on one board; give one port, not 2"):
        open_board(BOARD, BoardAddress((served, served)))


def test_pulled_cable_is_noticed() -> None:
    master, slave = os.openpty()
    channel_name = os.ttyname(slave)
    channel = SerialChannel(channel_name, BAUD)
    os.close(slave)
    os.close(master)
    with pytest.raises(DevboardError, match=f"connection to the board on {channel_name} was lost"):
        Link(channel).open(BAUD)
    channel.close()


@pytest.mark.parametrize(
    ("text", "ports", "baud"),
    [
        ("board:/dev/ttyUSB1", ("/dev/ttyUSB1",), BAUD),
        ("board:/dev/a,/dev/b@115200", ("/dev/a", "/dev/b"), 115_200),
        ("board:socket://host:5000", ("socket://host:5000",), BAUD),
        ("board:COM3@1000000", ("COM3",), 1_000_000),
    ],
)
def test_addresses(text: str, ports: tuple[str, ...], baud: int) -> None:
    address = parse_address(text)
    assert (address.ports, address.baud) == (ports, baud)
    assert str(address) == text


@pytest.mark.parametrize("text", ["board:", "board:a,", "board:a@0", "/dev/ttyUSB1", "board:a,b,c"])
def test_wrong_addresses_are_one_line(text: str) -> None:
    with pytest.raises(ValueError, match=r"names no board; the form is|names 3 ports"):
        parse_address(text)


def test_other_engine_is_rejected() -> None:
    with pytest.raises(
        ValueError, match=r"'boards' is no engine; choose from auto, .*, board:PORT"
    ):
        make_engine(BOARD, "boards")


def test_registers_are_refused_in_one_line() -> None:
    engine = engine_on(DirectChannel(model(BOARD)), BAUD, BOARD)
    with pytest.raises(ValueError, match="only the compiled engine can flip bits"):
        engine.flip("writer.data", 0)
