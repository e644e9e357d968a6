"""The board of a plain node: a microcontroller with a ``NodeProgram``, optionally an FPGA."""

from abc import abstractmethod
from typing import Any, ClassVar, Generic, TypeVar, Unpack

from cubestack.emulator.boards.contract import Board, BoardOptions
from cubestack.emulator.rtl.factory import EngineKind, make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.power import PowerTable
from cubestack.emulator.sim.processor import Processor
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.node.program import POWER_ON, NodeProgram

ProgramT = TypeVar("ProgramT", bound=NodeProgram)
SceneT = TypeVar("SceneT")


class NodeBoard(Board, Generic[ProgramT, SceneT]):
    """One emulated node; a sensor's subclass defines the class attributes.

    Attributes:
        interface: its messages.
        supplies: must contain a part "processor" with the states "sleep" and "run".
        costs: cycles of the processor's operations.
        scene_type: class of its scenes.
        boot_us: time from reset to the first instruction of ``main``.
    """

    interface: ClassVar[Interface]
    supplies: ClassVar[PowerTable]
    costs: ClassVar[CostTable]
    scene_type: ClassVar[type[Any]]
    boot_us: ClassVar[int] = 1_000
    program: ProgramT

    def __init__(
        self,
        scene: SceneT,
        *,
        engine: EngineKind = "auto",
        baud: int | None = None,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what it sees.
            engine: see ``make_engine``; without an FPGA, ValueError for any but "auto".
            baud: rate of the satellite's UART; None for the interface's.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        super().__init__(self.supplies, **common)
        self.scene = scene
        wiring = self._wiring()
        if wiring is not None:
            self.engine = make_engine(wiring, engine)
            for memory in self.engine.memories.values():
                self._scramble(memory)
        elif engine != "auto":
            raise ValueError(f"{self.interface.name} has no FPGA; omit engine {engine!r}")
        self._node_link(
            lambda: self.program.link, baud or self.interface.baud, self.interface.i2c_address
        )
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
            on_activity=lambda busy: self.power.set_state("processor", "run" if busy else "sleep"),
        )

    @abstractmethod
    def _boot(self, meter: Meter) -> ProgramT:
        """The program after a reset, which charges its cycles to ``meter``."""

    def _wiring(self) -> Wiring | None:
        return None

    @property
    def scene(self) -> SceneT:
        return self._scene

    @scene.setter
    def scene(self, scene: object) -> None:
        if not isinstance(scene, self.scene_type):
            known = self.scene_type.__name__
            raise TypeError(f"a scene of {self.interface.name} is a {known}, not {scene!r}")
        self._scene: SceneT = scene
