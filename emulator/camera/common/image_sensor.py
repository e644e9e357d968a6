"""What all image sensors have: a scene before them, a condition, a supply, and a pixel clock."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from fractions import Fraction
from typing import Any, ClassVar, Generic

from cubestack.emulator.camera.common.imager import Grey
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.stream import PixelClock
from cubestack.emulator.camera.common.view import C, S, View
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.registers import CameraRegisterMap

KEPT = 2
"""Pictures that are kept: one that was joined in the middle, and the whole one after it."""


class ImageSensor(ABC, Generic[S, C]):
    """One sensor behind its lens, powered from time 0 on.

    Attributes:
        scene_types: classes of scenes that it takes.
        sees: what it is and what it takes, for messages.
        on_change: called after the output from now on has become another than announced.
    """

    scene_types: ClassVar[tuple[type, ...]]
    sees: ClassVar[str]

    def __init__(
        self, seen: S | View[S, C], condition: C, table: CameraRegisterMap, hz: int
    ) -> None:
        """Power up.

        Args:
            seen: what it looks at; with a condition, that counts.
            condition: what lens and sensor are like, unless ``seen`` says.
            table: registers.
            hz: frequency of the pixel clock.
        """
        self.on_change: Callable[[], None] = lambda: None
        self._table = table
        self._condition = condition
        self.scene = seen
        self._hz = hz
        self._registers = RegisterFile(table)
        self._clock: PixelClock | None = PixelClock(hz)
        self._powered = True
        self._in_reset = False
        self._made: deque[tuple[Any, Grey]] = deque(maxlen=KEPT)

    @property
    def scene(self) -> S:
        """What it looks at; a new one is seen by the next frame that is rendered.

        A ``View`` changes the condition too. Raises TypeError for another kind of scene, ValueError
        for one that does not fit the sensor.
        """
        return self._scene

    @scene.setter
    def scene(self, seen: object) -> None:
        scene: Any = seen
        condition = self._condition
        if isinstance(seen, View):
            scene, condition = seen.scene, seen.condition
        if not any(isinstance(scene, kind) for kind in self.scene_types):
            raise TypeError(f"{self.sees}, not {scene!r}")
        self._look(scene, condition)

    @property
    def condition(self) -> C:
        """What lens and sensor are like."""
        return self._condition

    @condition.setter
    def condition(self, condition: C) -> None:
        self._look(self._scene, condition)

    def _look(self, scene: S, condition: C) -> None:
        self._check(scene, condition)
        self._scene, self._condition = scene, condition

    def _check(self, scene: S, condition: C) -> None:
        """Raise ValueError for a scene or a condition that does not fit the sensor."""

    @property
    def period(self) -> Fraction:
        """Time of one pixel clock in ps."""
        return Fraction(PS_PER_S, self._hz)

    @property
    def registers(self) -> RegisterFile:
        """Its registers, for who looks past its control bus."""
        return self._registers

    @property
    def running(self) -> bool:
        """Whether the part has power and is out of reset."""
        return self._clock is not None

    def power(self, on: bool, now_ps: int) -> None:
        """Turn the supply on or off; registers then have their reset values."""
        self._powered = on
        self._start_or_stop(now_ps)

    def _start_or_stop(self, now_ps: int) -> None:
        run = self._powered and not self._in_reset
        if run == self.running:
            return
        self._registers.reset()
        self._clock = PixelClock(self._hz, now_ps) if run else None
        self._restarted(now_ps)
        self.on_change()

    @property
    def rendered(self) -> Grey | None:
        """The picture (rows, columns) that was rendered last, of the latest frame looked at."""
        return self._made[-1][1] if self._made else None

    @abstractmethod
    def _restarted(self, now_ps: int) -> None:
        """Forget all that was under way when the part started or stopped."""

    def _once(self, frame: object, make: Callable[[], Grey]) -> Grey:
        """The picture of ``frame``, made anew only when frame, scene or condition is another."""
        key = (frame, self._scene, self._condition)
        made = next((each for each in self._made if each[0] == key), None)
        if made is None:
            made = key, make()
        else:
            self._made = deque((each for each in self._made if each is not made), KEPT)
        self._made.append(made)
        return made[1]
