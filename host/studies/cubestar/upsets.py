"""Flip bits of CubeStar's FPGA and memories, and report the effects.

Each bit of each register is hit at random times in each phase: FPGA idle, storing,
waiting between images, reading back. Each upset runs in a copy of the device. What the
processor sees is compared with the same loop without the upset, and the firmware's
answer with the truth.

examples:
  cubestack upsets cubestar
  cubestack upsets cubestar --registers 'writer.*' --frames 10 --json
  cubestack campaign seu-cubestar            the whole atlas, resumable, on all cores
"""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.layouts import BOARDS
from cubestack.emulator.boards.gateware import with_gateware
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubestar.pins import BOARD_PREFIXES, ENABLE, RNW, Layout
from cubestack.firmware_model.values import choice
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.emulation.emulated import EmulatedDevice
from cubestack.host.experiments import attitude as attitudes
from cubestack.host.experiments.cubestar.measure import wait_started
from cubestack.host.studies.upsets.experiment import UpsetExperiment
from cubestack.host.studies.upsets.gateware import DECIDED, GatewareUpsetOptions
from cubestack.host.studies.upsets.subject import BETWEEN, IDLE, STORING, Rig, Subject, UpsetVerdict

READING = "reading"

#: Of a loop with each layout; but for the published one the FPGA leads the processor to its memory
#: whenever it does not store.
PHASES = dict.fromkeys(Layout, (STORING, BETWEEN, READING)) | {
    Layout.COPIED: (IDLE, STORING, BETWEEN, READING)
}

MEMORIES = {
    Layout.COPIED: ("SRAM", "external"),
    Layout.SHARED: ("SRAM",),
    Layout.TWO_MEMORIES: ("SRAM1", "SRAM2"),
    Layout.TWO_BOARDS: ("SRAM1", "SRAM2"),
}

TIMEOUT_S = 20.0


def _scene(rng: np.random.Generator) -> Any:
    return attitudes.random_view(attitudes.SkyOptions(), CONDITION, rng)


def _start(emulated: EmulatedDevice[CubeStarBoard, CubeStar]) -> None:
    emulated.client.client.command("CaptureAndProcess")


def _judge(emulated: EmulatedDevice[CubeStarBoard, CubeStar]) -> UpsetVerdict:
    cubestar = emulated.client
    cubestar.client.wait_processed(TIMEOUT_S)
    status = cubestar.task_status()
    attitude = cubestar.attitude()
    if not attitude.valid:
        return UpsetVerdict("refused", status.name.lower().replace("_", " "))
    truth = emulated.board.truth()
    right = truth is not None and attitudes.is_right(*attitudes.errors(attitude.quaternion, truth))
    return UpsetVerdict("right" if right else "wrong")


def _state(engine: RtlEngine) -> str:
    boards = BOARD_PREFIXES if len(engine.wiring.acknowledges) > 1 else ("",)
    on = [board for board in boards if engine.get_pin(board + ENABLE)]
    if not on:
        return IDLE
    return READING if all(engine.get_pin(board + RNW) for board in on) else STORING


@dataclass(frozen=True, kw_only=True)
class CubeStarUpsetOptions(GatewareUpsetOptions):
    """Options of `cubestack upsets cubestar`."""

    layout: str = choice(
        Layout.COPIED.value,
        "memory layout, and the gateware for it (default 1, the published one)",
        tuple(layout.value for layout in Layout),
    )


@cache
def _wiring(layout: Layout, gateware: str, gateware_param: str) -> Wiring:
    return with_gateware(BOARDS[layout].wiring(), gateware, gateware_param)


@cache
def _rig_of(layout: Layout, gateware: str, gateware_param: str) -> Rig:
    subject = Subject(_scene, _start, _judge, _state, row_bytes=1024, ready=wait_started)
    return Rig(
        (subject,),
        partial(_wiring, layout, gateware, gateware_param),
        PHASES[layout],
        MEMORIES[layout],
        {"layout": layout.value, "gateware": gateware, "gateware_param": gateware_param},
    )


EXPERIMENT = UpsetExperiment(
    lambda options: _rig_of(Layout(options.layout), options.gateware, options.gateware_param),
    __doc__,
    decides=("layout", *DECIDED),
    options=CubeStarUpsetOptions,
)
