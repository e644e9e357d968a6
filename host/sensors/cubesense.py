"""CubeSense as a registered device."""

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.host.devices.device import (
    GATEWARE_OPTIONS,
    BoardOption,
    ConformanceNotes,
    Device,
    Report,
)
from cubestack.host.devices.registry import call, get

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.host.clients.cubesense.client import CubeSense

STUDIES = "cubestack.host.studies.cubesense"


#: Shipped variants of the FPGAs.
VARIANTS = CubeSenseSwitches.declared()["gateware"].choices


def _open_board(
    scene: "EarthSunScene | EarthSunView",
    *,
    gateware: str = "",
    switches: CubeSenseSwitches = DEFAULT_SWITCHES,
    **common: Any,
) -> "CubeSenseBoard":
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    if gateware in VARIANTS:
        gateware, switches = "", replace(switches, gateware=gateware)
    return CubeSenseBoard(scene, gateware=gateware, switches=switches, **common)


DEVICE: "Device[CubeSenseBoard, CubeSense]" = Device(
    name="cubesense",
    title="CubeSense",
    summary="directions of the Sun and of the Earth's centre",
    interface=INTERFACE,
    client=call("cubestack.host.clients.cubesense.client:CubeSense"),
    open_board=_open_board,
    load_scene=call("cubestack.emulator.camera.ov7620.scene_file:load_earth_sun_scene"),
    scene_form=call("cubestack.emulator.camera.ov7620.scene_form:earth_sun_form"),
    default_scene=cache(  # so that its light is computed once
        call(
            "cubestack.emulator.scene.earth_sun:EarthSunScene.facing",
            sun_deg=(20.0, 10.0),
            nadir_deg=(-8.0, 12.0),
        )
    ),
    default_scene_title="Earth and Sun",
    experiment=get("cubestack.host.experiments.cubesense.measure:EXPERIMENT"),
    studies={
        "calibrate": get(f"{STUDIES}.calibrate:EXPERIMENT"),
        "bench": get(f"{STUDIES}.benchmark:BENCHMARK"),
        "demo": get(f"{STUDIES}.demo:show"),
        "fidelity": get(f"{STUDIES}.fidelity:FIDELITY"),
        "campaign": lambda: STUDIES,
    },
    reports=(
        Report(
            "memory",
            "list the firmware's buffers against the processor's memories",
            get(f"{STUDIES}.memory:EXPERIMENT"),
        ),
        Report(
            "ball",
            "turn the nadir sensor in front of the test ball",
            get(f"{STUDIES}.ball:EXPERIMENT"),
        ),
        Report(
            "upsets",
            "flip bits of FPGAs and memories, and report the effects",
            get(f"{STUDIES}.upsets:EXPERIMENT"),
        ),
    ),
    overlay=call("cubestack.host.experiments.cubesense.pictures:overlay"),
    options=(
        BoardOption(
            "mcu_addressing", "FPGA variant whose addresses the processor can set (telecommand 100)"
        ),
        replace(
            GATEWARE_OPTIONS[0],
            meaning=f"a shipped variant of the FPGAs ({', '.join(VARIANTS)}) as --set gateware, or "
            "your own design of the pair, or of one FPGA: sun=..., nadir=... "
            "(docs/how-to/own-gateware.md)",
            metavar="VARIANT|FILE[:TOP]|MODULE:CLASS",
            known=VARIANTS,
        ),
        BoardOption(
            "uart",
            "protocol of the satellite's serial line (default node)",
            ("node", "registers"),
            "node",
        ),
    ),
    tops=get("cubestack.hdl.cubesense.tops:TOPS"),
    proofs=get("cubestack.hdl.proofs.cubesense:PROOFS"),
    contract=get("cubestack.hdl.contract.cubesense.declared:CONTRACT"),
    wirings=get("cubestack.emulator.boards.cubesense.wiring:WIRINGS"),
    conformance=ConformanceNotes(
        keys=frozenset({"Area"}),
        optional=frozenset({"SetNadirSearch", "NADIR_SEARCH"}),
        results=frozenset(
            [
                "CommunicationStatus",
                "TcmdProcessed",
                "Result1",
                "Result2",
                "Result1ThenSram1",
                "Result2ThenSram2",
                "Result1ThenSram2",
                "Result2ThenSram1",
                "Power",
                "ImageFrame",
                "ImageFrameInfo",
                "Details1",
                "Details2",
                "NadirEdges1",
                "NadirEdges2",
                "Quality1",
                "Quality2",
            ]
        ),
    ),
)
