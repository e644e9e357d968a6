"""Turn over bits of CubeStar's FPGA and memories, and see what comes of it.

Each bit of each register is hit at random times while the FPGA is idle, stores, waits
between pictures, and is read back; each upset in a copy of the running device. What the
processor sees is compared with the same loop without the upset, and what the firmware
answers with the truth.

examples:
  cubestack upsets cubestar
  cubestack upsets cubestar --registers 'writer.*' --frames 10 --json
  cubestack campaign seu-cubestar            the whole atlas, resumable, on all cores
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from cubestack.firmware_model.interface.cubestar.pins import ENABLE, RNW
from cubestack.host.experiments import attitude as attitudes
from cubestack.host.experiments.cubestar.measure import wait_started
from cubestack.host.experiments.upsets.experiment import UpsetExperiment
from cubestack.host.experiments.upsets.subject import BETWEEN, IDLE, STORING, Subject, Verdict

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.rtl.contract import RtlEngine
    from cubestack.emulator.rtl.wiring import Wiring
    from cubestack.host.clients.cubestar.client import CubeStar
    from cubestack.host.devices.emulated import EmulatedDevice

READING = "reading"

TIMEOUT_S = 20.0


def _scene(rng: np.random.Generator) -> Any:
    from cubestack.emulator.camera.mlx75412.lens import CONDITION

    return attitudes.random_view(attitudes.SkyOptions(), CONDITION, rng)


def _start(emulated: "EmulatedDevice[CubeStarBoard, CubeStar]") -> None:
    emulated.client.client.command("CaptureAndProcess")


def _judge(emulated: "EmulatedDevice[CubeStarBoard, CubeStar]") -> Verdict:
    cubestar = emulated.client
    cubestar.client.wait_processed(TIMEOUT_S)
    status = cubestar.task_status()
    attitude = cubestar.attitude()
    if not attitude.valid:
        return Verdict("refused", status.name.lower().replace("_", " "))
    truth = emulated.board.truth()
    right = truth is not None and attitudes.is_right(*attitudes.errors(attitude.quaternion, truth))
    return Verdict("right" if right else "wrong")


def _state(engine: "RtlEngine") -> str:
    if not engine.get_pin(ENABLE):
        return IDLE
    return READING if engine.get_pin(RNW) else STORING


def _wiring() -> "Wiring":
    from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring

    return cubestar_wiring()


EXPERIMENT = UpsetExperiment(
    (Subject(_scene, _start, _judge, _state, row_bytes=1024, ready=wait_started),),
    _wiring,
    (IDLE, STORING, BETWEEN, READING),
    ("SRAM", "external"),
    __doc__,
)
