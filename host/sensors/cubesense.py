"""CubeSense as a registered device."""

from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.devices.device import BoardOption, ConformanceNotes, Device, Report
from cubestack.host.devices.registry import call, get

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.host.clients.cubesense.client import CubeSense

STUDIES = "cubestack.host.studies.cubesense"


def _open_board(scene: "EarthSunScene | EarthSunView", **common: Any) -> "CubeSenseBoard":
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    return CubeSenseBoard(scene, **common)


DEVICE: "Device[CubeSenseBoard, CubeSense]" = Device(
    name="cubesense",
    title="CubeSense",
    summary="directions of the Sun and of the Earth's centre",
    interface=INTERFACE,
    client=call("cubestack.host.clients.cubesense.client:CubeSense"),
    open_board=_open_board,
    load_scene=call("cubestack.emulator.camera.ov7620.scene_file:load_earth_sun_scene"),
    scene_form=call("cubestack.emulator.camera.ov7620.scene_form:earth_sun_form"),
    default_scene=call(
        "cubestack.emulator.scene.earth_sun:EarthSunScene.facing",
        sun_deg=(20.0, 10.0),
        nadir_deg=(-8.0, 12.0),
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
