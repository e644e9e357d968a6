"""Development boards for tests: the protocol's reference model around a compiled design."""

import os
import pty
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from amaranth.hdl import Module

from cubestack.emulator.rtl import board_model
from cubestack.emulator.rtl.board_model.board import SimulatedBoard
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.devboard.channel import DevboardError
from cubestack.emulator.rtl.devboard.engine import DevboardEngine
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.emulator.rtl.devboard.link import Link
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import CameraPins, MemoryPins, Wiring
from cubestack.firmware_model.interface.devboard.table import BAUD
from cubestack.firmware_model.interface.pins import Pin, sram_pins
from cubestack.hdl.blocks.pinned import PinnedComponent, connect_ports
from cubestack.hdl.devboard.bridge import BridgeTiming
from cubestack.hdl.devboard.bridged import Bridged, bridged_cxxrtl
from cubestack.hdl.flow.generate import design_hash
from tests.hdl.harness.devboard_model import DevboardModel

UNUSED = "UNUSED_"

_CAMERA = (Pin("CLK", "input", ""), Pin("PIXEL", "input", "", 8), Pin("LINE", "input", ""))


class Bare(PinnedComponent):
    """A design whose ports are all separate pins, beside a camera and a memory that are unused."""

    def __init__(self, design: PinnedComponent) -> None:
        self._design = design
        ports = [port for pin in design.pins for port in pin.ports]
        super().__init__(
            [
                *(
                    Pin(
                        port.name,
                        "output" if port.output else "input",
                        "",
                        port.width,
                        level=port.level,
                    )
                    for port in ports
                ),
                *(pin.copy(f"{UNUSED}{pin}") for pin in (*sram_pins(1), *_CAMERA)),
            ]
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.design = design = self._design
        names = [(name, name) for name in design.signature.members]
        connect_ports(m, design, self, names)
        m.d.comb += [getattr(self, f"{UNUSED}SRAM_{pin}").eq(1) for pin in ("CE_N", "OE_N", "WE_N")]
        return m


@cache
def _bare(wiring: Wiring) -> Wiring:
    return Wiring(
        Bare(wiring.component),
        cameras=(CameraPins("unused", *(f"{UNUSED}{pin}" for pin in _CAMERA)),),
        memories=(MemoryPins("unused", UNUSED),),
        data_clock=wiring.data_clock,
        data=wiring.data,
        acknowledges=wiring.acknowledges,
        storing=lambda _level: (),
        settling_clocks=0,
    )


class CompiledDesign:
    """A design at its pins, for ``DevboardModel``."""

    def __init__(self, wiring: Wiring) -> None:
        self.engine = CompiledEngine(_bare(wiring))

    def set(self, levels: dict[str, int]) -> None:
        for name, level in levels.items():
            self.engine.set_pin(name, level)

    def get(self, name: str) -> int:
        return self.engine.get_pin(name)


_hash = cache(design_hash)


def model(wiring: Wiring, name: str = "top") -> DevboardModel:
    pins, lines = wiring.component.pins, lines_of(wiring)
    identity = bytes.fromhex(_hash(wiring.component))[:8]
    return DevboardModel(pins, lines, CompiledDesign(wiring), name=name, design_hash=identity)


class DirectChannel:
    """A line without delay; ``damage`` may change the bytes of either direction."""

    name = "direct"

    def __init__(self, board: Any, damage: Callable[[bytes], bytes] = lambda data: data) -> None:
        self.board, self.damage = board, damage
        self._answers = bytearray()
        self.connected = True

    def write(self, data: bytes) -> None:
        if not self.connected:
            raise DevboardError("the connection was lost")
        self._answers += self.damage(self.board.receive(self.damage(data)))

    def read(self, timeout_s: float) -> bytes:
        answers = bytes(self._answers)
        self._answers.clear()
        return answers

    def set_baud(self, baud: int) -> bool:
        return False

    def close(self) -> None:
        self.connected = False


def noisy(share: float, seed: int) -> Callable[[bytes], bytes]:
    """Replaces a share of the bytes by random ones."""
    random = np.random.default_rng(seed)

    def damage(data: bytes) -> bytes:
        array = np.frombuffer(data, np.uint8).copy()
        hit = random.random(len(array)) < share
        array[hit] ^= random.integers(1, 256, int(hit.sum()), np.uint8)
        return array.tobytes()

    return damage


def engine_on(
    channel: DirectChannel,
    wiring: Wiring,
    timing: SramTiming | None = None,
    *,
    skipping: bool = True,
) -> DevboardEngine:
    link = Link(channel)
    return DevboardEngine(wiring, link, link.open(BAUD), timing, skipping=skipping)


def direct(wiring: Wiring, timing: SramTiming | None = None, *, skipping: bool = True) -> RtlEngine:
    """An engine on a new board."""
    return engine_on(DirectChannel(model(wiring)), wiring, timing, skipping=skipping)


@contextmanager
def behind_pty(receive: Callable[[bytes], bytes]) -> Iterator[str]:
    """A pseudo-terminal whose other end answers with what ``receive`` returns; its path.

    OSError from ``receive`` pulls the cable.
    """
    master, slave = pty.openpty()
    tty.setraw(slave, termios.TCSANOW)

    def serve() -> None:
        with suppress(OSError):
            while data := os.read(master, 4096):
                answer = receive(data)
                while answer:
                    answer = answer[os.write(master, answer) :]
        os.close(master)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.close(slave)
        thread.join(5)


#: A quick serial line, and a design that settles at once.
QUICK = BridgeTiming(clock_hz=6_000_000, baud=3_000_000, settle=1)


def bridge_board(wiring: Wiring, name: str = "top", timing: BridgeTiming = QUICK) -> SimulatedBoard:
    """The gateware of a board, compiled: bridge and design before synthesis."""
    bridged = Bridged(wiring.component, lines_of(wiring), timing, name)
    header = Path(board_model.__file__).parent / "cxxrtl_board.h"
    design = bridged_cxxrtl(bridged, wiring.component)
    return SimulatedBoard(header.read_text(), timing.divider, design=design)
