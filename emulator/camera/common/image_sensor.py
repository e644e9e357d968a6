"""Base classes of the image sensors, and their parallel output.

Pixel data, HSync and VSync change with the falling edge of the pixel clock and are valid at its
rising edge (CubeStar thesis, appendix C).
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Generic

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.view import C, S, SkyCondition, View
from cubestack.emulator.light.library import light_library
from cubestack.emulator.light.pixels import Grey
from cubestack.emulator.scene.sky import PictureScene, Scene, SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.registers import CameraRegisterMap


@dataclass(frozen=True)
class StreamSegment:
    """A ``rtl.pixel_clock.PixelSegment``: blanking, or whole lines.

    Each line begins with its active columns, while HSync is high.
    """

    start_ps: int
    clocks: int
    vsync: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None


@dataclass(frozen=True)
class PixelClock:
    """A free-running clock: rising edge k is at floor(origin + k * period)."""

    hz: int
    origin_ps: int = 0

    def __post_init__(self) -> None:
        if self.hz <= 0:
            raise ValueError(f"a pixel clock needs a positive frequency, not {self.hz} Hz")

    @property
    def period(self) -> Fraction:
        return Fraction(PS_PER_S, self.hz)

    def edge_ps(self, k: int) -> int:
        return self.origin_ps + k * PS_PER_S // self.hz

    def end_ps(self, first: int, clocks: int) -> int:
        """End of ``clocks`` clocks for a consumer that counts from edge ``first``."""
        return self.edge_ps(first) + clocks * PS_PER_S // self.hz

    def first_edge(self, time_ps: int) -> int:
        """Number of the first rising edge at ``time_ps`` or later."""
        # floor(k * period) >= t exactly when k * period >= t, because t is an integer.
        return max(0, -(-(time_ps - self.origin_ps) * self.hz // PS_PER_S))


KEPT = 2
"""Cached images: one whose storing began in the middle, and the whole one after it."""


class ImageSensor(ABC, Generic[S, C]):
    """One sensor with its lens, powered from time 0 on: scene, condition, supply, pixel clock.

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
        light_library()  # compiled now, not within the first frame

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


class StarSensor(ImageSensor[Scene, SkyCondition]):
    """A star tracker's sensor, for the sky or a photograph: reset pin and two-wire bus."""

    scene_types = (SkyScene, PictureScene)
    sees = "a star tracker's scene is a sky or a picture"
    columns: ClassVar[int]
    rows: ClassVar[int]
    word_bytes: ClassVar[int]  # bytes per address of its registers

    def _check(self, scene: Scene, condition: SkyCondition) -> None:
        lens = condition.optics
        if (lens.columns, lens.rows) != (self.columns, self.rows):
            raise ValueError(
                f"the {self._table.camera} has {self.columns} x {self.rows} pixels, but the lens "
                f"is for {lens.columns} x {lens.rows}"
            )
        if isinstance(scene, PictureScene):
            scene.part(self.columns, self.rows)

    @property
    def temperature_c(self) -> float:
        return self.condition.temperature_c

    def set_reset_pin(self, level: int, now_ps: int) -> None:
        """Drive the reset pin, active low."""
        self._in_reset = not level
        self._start_or_stop(now_ps)

    def i2c_write(self, address: int, data: bytes, now_ps: int) -> bool:
        """Handle a write message to the 7-bit ``address``; returns whether to acknowledge it.

        ``data`` is a register's address, then words for that register and the following ones, upper
        byte first; an incomplete word is dropped.
        """
        if not self.running or address != self._table.i2c_address:
            return False
        head = self._table.address_bytes
        if len(data) >= head:
            self._registers.select(int.from_bytes(data[:head]))
            ends = range(head + self.word_bytes, len(data) + 1, self.word_bytes)
            words = [int.from_bytes(data[end - self.word_bytes : end]) for end in ends]
            self._write(words, now_ps)
        return True

    def i2c_read(self, address: int, count: int, now_ps: int) -> bytes | None:
        """Read ``count`` bytes from the last register address on; None if not acknowledged."""
        del now_ps
        if not self.running or address != self._table.i2c_address:
            return None
        size = self.word_bytes
        words = (self._registers.read().to_bytes(size) for _ in range(-(-count // size)))
        return b"".join(words)[:count]

    @abstractmethod
    def _write(self, words: list[int], now_ps: int) -> None: ...
