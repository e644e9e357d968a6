"""A powered-up device that runs the user's program: its power, and a host that talks to it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.iss.brown_out import POWER_ON
from cubestack.emulator.iss.flash_changes import FlashContents, FlashOperation, operations
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.ports.line import DirectSerial
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.host.clients.node import NodeClient
from cubestack.host.emulation.emulated import open_device
from cubestack.host.errors import (
    BadAnswerError,
    CommandRefusedError,
    NoAnswerError,
    NotSupportedError,
)
from cubestack.host.shell.registers import parse_values
from cubestack.host.studies.powerfail.scenario import (
    Answers,
    Question,
    Scenario,
    ScenarioError,
    Step,
)

READ_BYTES = 4096

BABBLE_BYTES = 1 << 16
"""A device that sends more in place of an answer has not answered."""

OBEYED, REFUSED, SILENT = "obeyed", "refused", "silent"
"""How a device answers a step."""


@dataclass(frozen=True)
class Setup:
    """What is tried, for workers in any process or machine."""

    image: str  #: value of the board's option ``firmware``
    scenario: Scenario


def marked(image: str, scenario: Scenario) -> str:
    """The image with its hash, so that a worker elsewhere rejects another one."""
    path = Path(image)
    rig = Rig(Setup(str(path.absolute()) if path.exists() else image, scenario))
    try:
        return rig.board.firmware
    finally:
        rig.close()


class Host:
    """The host's end of a serial line; records what it sends.

    Attributes:
        sent: time in ps and bytes of each write.
    """

    def __init__(self, rig: "Rig", line: str) -> None:
        self._serial = DirectSerial(rig.kernel, rig.board.uarts[line])
        self.sent = list[tuple[int, bytes]]()

    @property
    def now_ps(self) -> int:
        return self._serial.now_ps

    def write(self, data: bytes) -> None:
        self.sent.append((self.now_ps, data))
        self._serial.write(data)

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        return self._serial.read(max_bytes, timeout_s)

    def read_until(self, ended: Callable[[bytes], bool], timeout_s: float) -> bytes | None:
        """Read until ``ended`` holds for what arrived; None after ``timeout_s``."""
        late_ps, data = self.now_ps + round(timeout_s * PS_PER_S), b""
        while not ended(data):
            left_s = (late_ps - self.now_ps) / PS_PER_S
            piece = self.read(READ_BYTES, left_s) if left_s > 0 else b""
            data += piece
            if not piece or len(data) > BABBLE_BYTES:
                return None
        return data

    def drop(self) -> None:
        """Drop what has arrived."""
        while self.read(READ_BYTES, 0.0):
            pass

    def close(self) -> None:
        """Nothing to release."""


class Rig:
    """A device with the program of a set-up, powered up at time 0."""

    def __init__(self, setup: Setup) -> None:
        """Power up.

        Raises ScenarioError for a device without own firmware or without that serial line, and
        ValueError for a wrong image.
        """
        scenario = setup.scenario
        self.scenario = scenario
        options: dict[str, Any] = {**(scenario.options or {}), "firmware": setup.image}
        emulated = open_device(scenario.device, seed=scenario.seed, **options)
        self.emulated, self.board, self.kernel = emulated, emulated.board, emulated.board.kernel
        if not isinstance(self.board.processor, FirmwareProcessor):
            raise ScenarioError(f"{scenario.device} runs no image")
        self.processor = self.board.processor
        self.machine = self.processor.machine
        self.machine.log_flash()
        uarts = self.board.uarts
        self._line = scenario.line or next(iter(uarts))
        if self._line not in uarts:
            raise ScenarioError(f"no serial line {self._line!r}; there are {', '.join(uarts)}")
        self.host = Host(self, self._line)

    @property
    def image(self) -> Image:
        assert self.machine.image is not None
        return self.machine.image

    @cached_property
    def symbols(self) -> Symbols:
        return Symbols.of(self.machine.image)

    @property
    def node(self) -> NodeClient:
        interface = self.emulated.device.interface
        return NodeClient(self.host, interface, timeout_s=self.scenario.timeout_s, retries=0)

    def close(self) -> None:
        self.emulated.close()

    # Power

    def power_up(self, contents: FlashContents | None, rng: np.random.Generator) -> None:
        """Restore the supply: the flash has these contents, or its own, and RAM random ones."""
        self.processor.catch_up()
        if contents is not None:
            contents.load(self.machine)
        self.machine.ram[:] = np.frombuffer(rng.bytes(self.machine.ram.size), np.uint8)
        self.restart(POWER_ON)

    def restart(self, cause: int) -> None:
        """Reset with these bits of RMU_RSTCAUSE, and forget what was on the line."""
        self.board.uarts[self._line].host_drops()
        self.machine.reset(cause)
        self.processor.wake()
        self.host.drop()

    def flash_operations(self) -> list[FlashOperation]:
        """Operations of the flash since the last call."""
        return operations(self.machine.flash_changes())

    # What a host says

    def await_start(self) -> None:
        """Wait until the program has started, or should have."""
        if ready := _bytes(self.scenario.ready):
            self.host.read_until(lambda data: ready in data, self.scenario.boot_s)
        else:
            self.emulated.wait(self.scenario.boot_s)
        self.host.drop()

    def ask(self) -> Answers:
        """Answers to all questions of the scenario."""
        return tuple(self._ask(one) for one in self.scenario.question)

    def _ask(self, question: Question) -> str | None:
        if question.telemetry:
            return self._telemetry(question.telemetry)
        self.host.drop()
        self.host.write(_bytes(question.send))
        end = _bytes(question.end)
        answer = self.host.read_until(lambda data: end in data, self.scenario.timeout_s)
        return None if answer is None else answer.partition(end)[0].decode("latin-1").strip()

    def _telemetry(self, words: str) -> str | None:
        frame, *fields = words.split()
        try:
            values = self.node.telemetry(frame)
        except NoAnswerError:
            return None
        except BadAnswerError as error:
            return str(error)
        except (InterfaceError, NotSupportedError) as error:
            raise ScenarioError(f"question {words!r}: {error}") from None
        missing = [name for name in fields if name not in values]
        if missing:
            raise ScenarioError(f"{frame} has no field {missing[0]!r}, only {', '.join(values)}")
        return " ".join(f"{name}={values[name]!s}" for name in fields or values)

    def perform(self, step: Step) -> str:
        """Send a command; returns ``OBEYED``, ``REFUSED`` or ``SILENT``."""
        if step.telecommand:
            return self._telecommand(step.telecommand)
        self.host.drop()
        self.host.write(_bytes(step.send))
        answer, refused = _bytes(step.answer), _bytes(step.refused)

        def ended(data: bytes) -> bool:
            return answer in data or bool(refused and refused in data)

        data = self.host.read_until(ended, self.scenario.timeout_s)
        return SILENT if data is None else OBEYED if answer in data else REFUSED

    def _telecommand(self, words: str) -> str:
        name, *values = words.split()
        node = self.node
        try:
            parameters = parse_values(node.interface.telecommand(name), values)
            node.command(name, **parameters)
        except InterfaceError as error:
            raise ScenarioError(f"step {words!r}: {error}") from None
        except CommandRefusedError:
            return REFUSED
        except (NoAnswerError, BadAnswerError):
            return SILENT
        return OBEYED


def _bytes(text: str) -> bytes:
    return text.encode("latin-1")


def contents_after(
    before: FlashContents, done: list[FlashOperation] | tuple[FlashOperation, ...]
) -> FlashContents:
    """A copy of ``before`` after these operations."""
    contents = before.copy()
    for operation in done:
        contents.apply(operation)
    return contents


def seeded(*numbers: int) -> np.random.Generator:
    """Random numbers for one purpose."""
    return np.random.default_rng(numbers)
