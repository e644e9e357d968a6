"""Flip bits of CubeSense's two FPGAs and memories, and report the effects.

A loop stores an image of the Sun and one of the Earth in one of the two memories, chosen at random;
one comes over the link. Each bit of each register is hit at random times in each phase: both FPGAs
idle, storing, waiting between images, storing the other one's image, reading. Each upset runs in a
copy of the device. What the processor sees is compared with the same loop without the upset, and
the firmware's answer with the truth.

examples:
  cubestack upsets cubesense
  cubestack upsets cubesense --registers 'sun.*' --json
  cubestack upsets cubesense --gateware sun=sun.v,nadir=nadir.v --answers corrected
  cubestack campaign seu-cubesense           the whole atlas, resumable, on all cores
"""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from cubestack.emulator.boards.cubesense.board import CubeSenseBoard, wiring_of
from cubestack.emulator.boards.cubesense.wiring import with_designs
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.cubesense.fpga import Action, actions
from cubestack.firmware_model.interface.cubesense.pins import CONTROLS
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.values import choice, text
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.emulation.emulated import EmulatedDevice
from cubestack.host.experiments.cubesense.measure import CubeSenseOptions, is_right, random_view
from cubestack.host.studies.upsets.experiment import UpsetExperiment
from cubestack.host.studies.upsets.gateware import DECIDED, GatewareUpsetOptions
from cubestack.host.studies.upsets.subject import BETWEEN, IDLE, STORING, Rig, Subject, UpsetVerdict

LINKED, READING = "linked", "reading"

#: Shipped variants of the FPGAs.
VARIANTS = CubeSenseSwitches.declared()["gateware"].choices

#: Largest angle of the Sun, so that the Earth is in the nadir camera's field.
SUN_ANGLE_DEG = 25.0


def _scene(rng: np.random.Generator) -> Any:
    return random_view(CubeSenseOptions(sun_angle=SUN_ANGLE_DEG), Camera.SUN, rng)


def _start(sram: Sram, emulated: EmulatedDevice[CubeSenseBoard, CubeSense]) -> None:
    for camera in Camera:
        emulated.client.client.command("CaptureAndDetect", Camera=camera, Sram=sram)


def _judge(emulated: EmulatedDevice[CubeSenseBoard, CubeSense]) -> UpsetVerdict:
    reasons = []
    for camera in Camera:
        measured = emulated.client.wait_measured(camera)
        right = is_right(emulated, camera, measured)
        if measured.detected and not right:
            return UpsetVerdict("wrong")
        if not measured.detected:
            told = measured.detect if measured.capture.stored else measured.capture
            reasons.append(f"{camera.name.lower()}: {told.name.lower().replace('_', ' ')}")
    return UpsetVerdict("refused", ", ".join(reasons)) if reasons else UpsetVerdict("right")


def _state(engine: RtlEngine) -> str:
    commanded = actions(*(engine.get_pin(pin) for pin in CONTROLS))
    if Action.STORE_OTHER in commanded:
        return LINKED
    if Action.STORE in commanded:
        return STORING
    return IDLE if set(commanded) == {Action.STANDBY} else READING


@dataclass(frozen=True, kw_only=True)
class CubeSenseUpsetOptions(GatewareUpsetOptions):
    """Options of `cubestack upsets cubesense`."""

    gateware: str = text(
        DEFAULT_SWITCHES.gateware,
        f"shipped variant of both FPGAs ({', '.join(VARIANTS)}; default one-search), or your own "
        "design of the pair, or of one FPGA: sun=..., nadir=... (docs/how-to/own-gateware.md)",
        metavar="VARIANT|FILE[:TOP]|MODULE:CLASS",
    )
    answers: str = choice(
        DEFAULT_SWITCHES.gateware,
        "shipped variant like which your own design answers over the link, and whose other FPGA "
        "it meets",
        VARIANTS,
    )


@cache
def _wiring(gateware: str, gateware_param: str, answers: str) -> Wiring:
    if gateware in VARIANTS:
        return with_designs(wiring_of(gateware), "", gateware_param)
    return with_designs(wiring_of(answers), gateware, gateware_param)


@cache
def _rig_of(gateware: str, gateware_param: str, answers: str) -> Rig:
    subjects = tuple(
        Subject(_scene, partial(_start, sram), _judge, _state, row_bytes=640) for sram in Sram
    )
    phases = (IDLE, STORING, BETWEEN, LINKED, READING)
    design = {"gateware": gateware, "gateware_param": gateware_param}
    wiring = partial(_wiring, **design, answers=answers)
    board = design | ({} if gateware in VARIANTS else {"set": f"gateware={answers}"})
    return Rig(subjects, wiring, phases, ("sun", "nadir"), board)


EXPERIMENT = UpsetExperiment(
    lambda options: _rig_of(options.gateware, options.gateware_param, options.answers),
    __doc__,
    decides=("profile", "set", *DECIDED, "mcu_addressing", "uart"),
    options=CubeSenseUpsetOptions,
)
