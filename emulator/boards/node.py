"""The board of a plain node, and peripherals that boards share.

A plain node is a microcontroller with a ``NodeProgram``, optionally with an FPGA.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, Unpack

from cubestack.emulator.boards.contract import Board, BoardOptions
from cubestack.emulator.camera.common.image_sensor import StarSensor
from cubestack.emulator.sim.power import PowerTable
from cubestack.emulator.sim.processor import Processor
from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US
from cubestack.firmware_model.interface import checks
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.mcu.requests import CameraTransfer
from cubestack.firmware_model.node.hardware import NodeHardware
from cubestack.firmware_model.node.program import POWER_ON, NodeProgram

if TYPE_CHECKING:
    from cubestack.emulator.rtl.factory import EngineKind
    from cubestack.emulator.rtl.wiring import Wiring


@dataclass(eq=False)
class NodePeripherals(NodeHardware):
    """Peripherals that every node's program uses; boards add their own in a subclass."""

    _board: Board

    def uart_send(self, data: bytes) -> None:
        self._board.uart.send(data)

    def uart_backlog(self) -> int:
        return self._board.uart.backlog

    def wake(self) -> None:
        self._board.processor.wake()

    def uptime_us(self) -> int:
        return self._board.kernel.now // PS_PER_US


@dataclass(frozen=True)
class I2cCameraBus:
    """A camera's separate control bus: 7-bit address of the camera, and bits per second."""

    camera: StarSensor
    address: int
    hz: int

    def transfer_ps(self, request: CameraTransfer) -> int:
        """Nine bits per byte, including addresses, and one bit per start and stop."""
        bytes_on_wire = 1 + len(request.data) + (1 + request.read if request.read else 0)
        starts_and_stop = 3 if request.read else 2
        return (9 * bytes_on_wire + starts_and_stop) * PS_PER_S // self.hz

    def transfer(self, request: CameraTransfer, now_ps: int) -> bytes | None:
        """Write, then read; None if not acknowledged."""
        if not self.camera.i2c_write(self.address, request.data, now_ps):
            return None
        return self.camera.i2c_read(self.address, request.read, now_ps)


ProgramT = TypeVar("ProgramT", bound=NodeProgram)
SceneT = TypeVar("SceneT")


@dataclass(frozen=True)
class _OwnPins:
    """Pins of the processor that lead to no FPGA."""

    inputs: Mapping[str, Callable[[], int]]
    outputs: Mapping[str, Callable[[int], None]]

    def __contains__(self, pin: object) -> bool:
        return pin in self.inputs or pin in self.outputs

    def get_pin(self, pin: str) -> int:
        return self.inputs[pin]()

    def set_pin(self, pin: str, level: int) -> None:
        self.outputs[pin](level)


class NodeBoard(Board, Generic[ProgramT, SceneT]):
    """One emulated node; a sensor's subclass defines the class attributes.

    Attributes:
        program_type: class of the firmware.
        supplies: must contain a part "processor" with the states "sleep" and "run".
        costs: cycles of the processor's operations.
        scene_type: class of its scenes.
        boot_us: time from reset to the first instruction of ``main``.
    """

    program_type: ClassVar[type[NodeProgram]]
    supplies: ClassVar[PowerTable]
    costs: ClassVar[CostTable]
    scene_type: ClassVar[type[Any]]
    boot_us: ClassVar[int] = 1_000
    program: ProgramT

    def __init__(
        self,
        scene: SceneT,
        *,
        engine: "EngineKind" = "auto",
        baud: int | None = None,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what it sees.
            engine: see ``make_engine``; without an FPGA, ValueError for any but "auto".
            baud: rate of the satellite's UART; None for the interface's.
            common: seed, kernel and i2c_bus, see ``Board``.

        Raises SensorError for a mistake in the declaration of the sensor.
        """
        self._check_class()
        super().__init__(self.supplies, **common)
        self.scene = scene
        interface = self.program_type.interface
        wiring = self._wiring()
        if wiring is not None:
            from cubestack.emulator.rtl.factory import make_engine

            self.engine = make_engine(self._fitted(wiring), engine)
            for memory in self.engine.memories.values():
                self._scramble(memory)
        elif engine != "auto":
            raise ValueError(f"{interface.name} has no FPGA; omit engine {engine!r}")
        self._boot(Meter(self.costs)).check()
        self._node_link(lambda: self.program.link, baud or interface.baud, interface.i2c_address)
        meter = Meter(self.costs)

        def boot(_cause: int) -> ProgramT:
            self.program = self._boot(meter)
            return self.program

        self.processor = Processor(
            self.kernel,
            meter,
            self.engine,
            None,
            boot,
            power_on_cause=POWER_ON,
            boot_us=self.boot_us,
            other_pins=_OwnPins(self.inputs(), self.outputs()),
            on_activity=lambda busy: self.power.set_state("processor", "run" if busy else "sleep"),
        )

    def inputs(self) -> Mapping[str, Callable[[], int]]:
        """Pins that the program reads and that lead to no FPGA, each with what returns its level.

        The result register of a converter is a pin too: its level is the number.
        """
        return {}

    def outputs(self) -> Mapping[str, Callable[[int], None]]:
        """Pins that the program sets and that lead to no FPGA, each with what takes its level."""
        return {}

    def _boot(self, meter: Meter) -> ProgramT:
        """The program after a reset, which charges its cycles to ``meter``."""
        return self.program_type(NodePeripherals(self), meter)  # type: ignore[return-value]

    def _check_class(self) -> None:
        owner = type(self)
        checks.check_class(
            owner,
            program_type="the class of its firmware, a NodeProgram",
            scene_type="the class of its scenes",
            costs="the cost table of its processor, such as CORTEX_M3",
            supplies="a PowerTable",
        )
        checks.check_class(self.program_type, interface="the table of its messages")
        parts = self.supplies.parts
        checks.check_supplies(owner, {name: part.ma for name, part in parts.items()})

    def _wiring(self) -> "Wiring | None":
        return None

    @property
    def scene(self) -> SceneT:
        return self._scene

    @scene.setter
    def scene(self, scene: object) -> None:
        if not isinstance(scene, self.scene_type):
            known = self.scene_type.__name__
            name = self.program_type.interface.name
            raise TypeError(f"a scene of {name} is a {known}, not {scene!r}")
        self._scene: SceneT = scene
