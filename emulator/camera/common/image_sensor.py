"""Base class of the image sensors: scene, condition, supply and pixel clock."""

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
"""Cached images: one whose storing began in the middle, and the whole one after it."""


class ImageSensor(ABC, Generic[S, C]):
    """One sensor with its lens, powered from time 0 on.

    Attributes:
        scene_types: accepted classes of scenes.
        sees: text of the error for other scenes.
        on_change: called after the output differs from now on from what ``segment_at`` announced.
    """

    scene_types: ClassVar[tuple[type, ...]]
    sees: ClassVar[str]

    def __init__(
        self, scene: S | View[S, C], condition: C, table: CameraRegisterMap, hz: int
    ) -> None:
        """Power up.

        Args:
            scene: the scene, or a view whose condition replaces ``condition``.
            condition: state of lens and sensor.
            table: registers.
            hz: frequency of the pixel clock.
        """
        self.on_change: Callable[[], None] = lambda: None
        self._table = table
        self._condition = condition
        self.scene = scene
        self._hz = hz
        self._registers = RegisterFile(table)
        self._clock: PixelClock | None = PixelClock(hz)
        self._powered = True
        self._in_reset = False
        self._images: deque[tuple[Any, Grey]] = deque(maxlen=KEPT)

    @property
    def scene(self) -> S:
        """What it looks at; a new scene takes effect with the next rendered frame.

        A ``View`` changes the condition too. Raises TypeError for another class of scene, and
        ValueError for one that does not fit the sensor.
        """
        return self._scene

    @scene.setter
    def scene(self, view: object) -> None:
        scene: Any = view
        condition = self._condition
        if isinstance(view, View):
            scene, condition = view.scene, view.condition
        if not any(isinstance(scene, kind) for kind in self.scene_types):
            raise TypeError(f"{self.sees}, not {scene!r}")
        self._set_view(scene, condition)

    @property
    def condition(self) -> C:
        return self._condition

    @condition.setter
    def condition(self, condition: C) -> None:
        self._set_view(self._scene, condition)

    def _set_view(self, scene: S, condition: C) -> None:
        self._check(scene, condition)
        self._scene, self._condition = scene, condition

    def _check(self, scene: S, condition: C) -> None:
        """Raise ValueError for a scene or a condition that does not fit the sensor."""

    @property
    def period(self) -> Fraction:
        return Fraction(PS_PER_S, self._hz)

    @property
    def registers(self) -> RegisterFile:
        """Its registers, for access without the control bus."""
        return self._registers

    @property
    def running(self) -> bool:
        """Whether the part has power and is out of reset."""
        return self._clock is not None

    def power(self, on: bool, now_ps: int) -> None:
        """Switch the supply; the registers then have their reset values."""
        self._powered = on
        self._start_or_stop(now_ps)

    def _start_or_stop(self, now_ps: int) -> None:
        run = self._powered and not self._in_reset
        if run == self.running:
            return
        self._registers.reset()
        self._clock = PixelClock(self._hz, now_ps) if run else None
        self._on_restart(now_ps)
        self.on_change()

    @property
    def rendered(self) -> Grey | None:
        """The image (rows, columns) rendered last."""
        return self._images[-1][1] if self._images else None

    @abstractmethod
    def _on_restart(self, now_ps: int) -> None: ...

    def _cached(self, frame: object, render: Callable[[], Grey]) -> Grey:
        """The image of ``frame``; rendered again only after a change of scene or condition."""
        key = (frame, self._scene, self._condition)
        image = next((each for each in self._images if each[0] == key), None)
        if image is None:
            image = key, render()
        else:
            self._images = deque((each for each in self._images if each is not image), KEPT)
        self._images.append(image)
        return image[1]
