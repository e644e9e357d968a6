"""The boards of a CubeStar without the processor's program.

CubeStar thesis, section 5.2 and tables C.1 to C.4: camera, FPGA, SRAM and processor, and the
supplies of all three boards. :mod:`cubestack.emulator.boards.cubestar.layouts` has the memory
layouts.
"""

from collections import deque
from dataclasses import replace
from functools import lru_cache
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.contract import Board, BoardOptions
from cubestack.emulator.boards.cubestar.layouts import BOARDS
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.sensor import Mlx75412
from cubestack.emulator.faults.sites import CameraSite, Sites
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import EngineKind, make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar.codes import ResetCause
from cubestack.firmware_model.interface.cubestar.pins import Layout

FORCED_RESETS = {
    "brown-out": ResetCause.BROWN_OUT_UNREGULATED,
    "brown-out-regulated": ResetCause.BROWN_OUT_REGULATED,
    "reset-pin": ResetCause.EXTERNAL_PIN,
    "hang": ResetCause.WATCHDOG,
    "lock-up": ResetCause.LOCKUP,
}
"""Causes of resets that the program did not request, the most common one first."""


@lru_cache(maxsize=len(BOARDS))
def _wiring(layout: Layout) -> Wiring:
    """Cached, as the hash of the design, with which an engine finds its library, is slow."""
    return BOARDS[layout].wiring()


class CubeStarStack(Board):
    """The boards of a CubeStar; a subclass adds the processor.

    Attributes:
        external_ram: SRAM on the processor's external bus, empty if there is none.
        stored: exposures of the frames stored last, the newest one at the end; None for a frame
            that the camera did not send.
    """

    engine: RtlEngine

    def __init__(
        self,
        scene: Scene | SkyView,
        *,
        engine: EngineKind,
        layout: Layout,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up all but the processor; arguments as for ``CubeStarBoard``."""
        self.layout = BOARDS[layout]
        super().__init__(self.layout.power, **common)
        self.engine = make_engine(self._fitted(_wiring(layout)), kind=engine)
        self.camera = Mlx75412(scene, seed=self.seed)
        ram_bytes = EXTERNAL_RAM_BYTES if self.layout.external_ram else 0
        self.external_ram = np.zeros(ram_bytes, np.uint8)
        self._scramble(self.external_ram)
        for memory in self.engine.memories.values():
            self._scramble(memory)
        self.engine.attach(self.camera)
        self.camera.on_change = self._camera_changed
        self._pins = dict.fromkeys(self.layout.controls, 0)
        self._accesses = False
        self._storing_since_ps = 0
        self.stored: deque[RollingShutter | None] = deque([None], maxlen=4)

    @property
    def scene(self) -> Scene:
        return self.camera.scene

    @scene.setter
    def scene(self, scene: object) -> None:
        self.camera.scene = scene

    def sites(self) -> Sites:
        return replace(
            super().sites(),
            controls=self.layout.controls,
            cameras={"imager": CameraSite(self.camera, self.camera.power, "imager")},
            memories={"external": self.external_ram} if self.layout.external_ram else {},
        )

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """See ``Board``; one image per bank of a memory."""
        found = {}
        for name, memory in self.engine.memories.items():
            banks = memory[: memory.size // (ROWS * COLUMNS) * ROWS * COLUMNS]
            for number, bank in enumerate(banks.reshape(-1, ROWS, COLUMNS)):
                found[f"{name}, bank {number}"] = bank
        return found

    def truths(self) -> dict[str, NDArray[np.float64]]:
        truth = self.truth()
        return {} if truth is None else {"attitude": truth}

    def _camera_changed(self) -> None:
        self.engine.stream_changed()
        self.power.set_state("imager", "enabled" if self.camera.enabled else "disabled")

    def truth(self) -> NDArray[np.float64] | None:
        """Attitude (4,) at mid-exposure of the middle row of the latest stored frame, or None."""
        latest = self.stored[-1]
        if latest is None:
            return None
        return self.camera.scene.truth(latest.mid_exposure_ps((ROWS - 1) / 2))

    def _pin_changed(self, pin: str, level: int) -> None:
        stored, self._pins[pin] = self.layout.storing(self._pins), level
        stores = self.layout.storing(self._pins)
        if stores > stored:
            self._storing_since_ps = self.kernel.now
        elif stores < stored:
            # The FPGA stored the first whole frame, even if the program stopped it later.
            self.stored.append(self.camera.frame_from(self._storing_since_ps))
        self._set_states()

    def _access_changed(self, busy: bool) -> None:
        self._accesses = busy
        self._set_states()

    def _set_states(self) -> None:
        for part, state in self.layout.states(self._pins, self._accesses).items():
            self.power.set_state(part, state)

    def _supply_switched(self, channel: str, on: bool) -> None:
        # At a latch-up, the FPGA may be ahead of the kernel; see sim/processor.py.
        now_ps = max(self.kernel.now, self.engine.now_ps)
        self.engine.run(now_ps)
        if channel == "imager":
            self.camera.power(on, now_ps)
        srams, external = self.engine.memories, self.layout.external_ram
        if not external:
            # A memory is accessible only if both it and the FPGA have supply.
            accessible = all(self.power.is_on(name) for name in ("imager", "memory"))
            for name in srams:
                self.engine.power_memory(name, accessible)
        if not on:
            feeds_srams = channel == ("imager" if external else "memory")
            for memory in srams.values() if feeds_srams else [self.external_ram]:
                self._scramble(memory)
