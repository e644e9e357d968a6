"""AraMiS' star tracker as a registered device."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.aramis import IMAGE_BYTES, INTERFACE
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.host.devices.device import ConformanceNotes, Device, Engine, Report
from cubestack.host.devices.registry import call, get

if TYPE_CHECKING:
    from cubestack.emulator.boards.aramis.board import AramisBoard
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.scene.form import SceneForm
    from cubestack.emulator.scene.sky import Scene
    from cubestack.host.clients.aramis.client import Aramis

STUDIES = "cubestack.host.studies.aramis"
EFFECTS = "cubestack.host.conformance.effects"
BOARD = "cubestack.emulator.boards.aramis"

POINTING_DEG = (84.0, -1.0, 0.0)  # Orion's belt


def _open_board(
    scene: "Scene | SkyView", *, baud: int | None = None, engine: Engine = "auto", **common: Any
) -> "AramisBoard":
    from cubestack.emulator.boards.aramis.board import AramisBoard
    from cubestack.emulator.boards.aramis.catalogue import onboard_database

    if engine != "auto":
        raise ValueError(f"aramis has no FPGA: leave --engine {engine} out")
    catalogue = common.pop("catalogue", None) or onboard_database()
    return AramisBoard(scene, catalogue, baud=baud or INTERFACE.baud, **common)


def _load_scene(path: Path) -> "SkyView":
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.mt9m001.lens import CONDITION

    return load_scene(path, CONDITION)


def _scene_form() -> "SceneForm[SkyView]":
    from cubestack.emulator.camera.common.scene_form import sky_form
    from cubestack.emulator.camera.mt9m001.lens import CONDITION

    return sky_form(CONDITION)


DEVICE: "Device[AramisBoard, Aramis]" = Device(
    name="aramis",
    title="AraMiS",
    summary="attitudes of the star tracker without FPGA",
    interface=INTERFACE,
    client=call("cubestack.host.clients.aramis.client:Aramis"),
    open_board=_open_board,
    load_scene=_load_scene,
    scene_form=_scene_form,
    default_scene=call("cubestack.emulator.scene.sky:SkyScene.pointing", *POINTING_DEG),
    default_scene_title="Orion",
    experiment=get("cubestack.host.experiments.aramis.measure:EXPERIMENT"),
    studies={
        "calibrate": get(f"{STUDIES}.calibrate:EXPERIMENT"),
        "bench": get(f"{STUDIES}.benchmark:BENCHMARK"),
        "demo": get(f"{STUDIES}.demo:show"),
        "fidelity": get(f"{STUDIES}.fidelity:FIDELITY"),
        "campaign": lambda: STUDIES,
    },
    reports=(
        Report(
            "catalogue",
            "compile the onboard star catalogue and summarise it",
            get(f"{STUDIES}.catalogue:EXPERIMENT"),
        ),
    ),
    has_fpga=False,
    prepare=lambda shown: call(f"{BOARD}.catalogue:onboard_database", progress=shown)(),
    image_sensor=REGISTERS,
    conformance=ConformanceNotes(
        effects={
            "StreamDownImage": call(f"{EFFECTS}:check_stream", picture_bytes=IMAGE_BYTES),
            "WriteCameraRegister": call(
                f"{EFFECTS}:check_camera_register", address=REGISTERS["SHUTTER_WIDTH"].address
            ),
        },
        ended_by={"StartLoop": "StopLoop"},
        not_shown=frozenset(
            {
                "GetAttitudeNearPoint",
                "SetBodyRotation",
                "SetSystemTime",
                "StartLoop",
                "SetIdentification",
                "SetField",
            }
        ),
        results=frozenset(
            [
                "ExtendedIdentification.ResetCause",
                "TcmdProcessed",
                "SensorStatus",
                "SystemTime",
                "Attitude",
                "BodyAttitude",
                "Boresight",
                "UploadStatus",
                "ImageBlock",
                "CameraRegister",
                "LoopStatus",
                "DetectionSummary",
                "IdentificationSummary",
                "StarDetails",
                "SupplyStatus",
                "Quality",
            ]
        ),
    ),
)
