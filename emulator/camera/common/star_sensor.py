"""Base class of star trackers' image sensors: reset pin, two-wire bus, scenes."""

from abc import abstractmethod
from typing import ClassVar

from cubestack.emulator.camera.common.image_sensor import ImageSensor
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.scene.sky import PictureScene, Scene, SkyScene


class StarSensor(ImageSensor[Scene, SkyCondition]):
    """A sensor for the sky or a photograph."""

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
