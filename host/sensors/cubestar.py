"""CubeStar as a registered device."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, INTERFACE
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.host.devices.device import BoardOption, ConformanceNotes, Device, Report
from cubestack.host.devices.own_firmware import FIRMWARE_OPTIONS, OwnFirmware, firmware_option
from cubestack.host.devices.registry import call, get

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
    from cubestack.emulator.boards.cubestar.stack import CubeStarStack
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.scene.form import SceneForm
    from cubestack.emulator.scene.sky import Scene
    from cubestack.host.clients.cubestar.client import CubeStar

STUDIES = "cubestack.host.studies.cubestar"
EFFECTS = "cubestack.host.conformance.effects"

POINTING_DEG = (84.0, -1.0, 0.0)  # Orion's belt
MAG_LIMIT = 3.8
"""Only stars of the onboard list: fainter ones would require a higher threshold first."""

REFERENCE = "reference"
"""Value of ``firmware`` that selects the reference firmware in C."""

WIDEST_PAIR_DEG = max(map(float, CubeStarSwitches.declared()["pair_limit"].choices))
"""The list in flash has every pair that any switch setting needs."""


def _open_board(
    scene: "Scene | SkyView",
    *,
    baud: int | None = None,
    layout: str = Layout.COPIED.value,
    **common: Any,
) -> "CubeStarStack":
    own = OwnFirmware.of(common)
    rate, chosen = baud or INTERFACE.baud, Layout(layout)
    if own.firmware:
        return _open_with(own, scene, baud=rate, layout=chosen, **common)
    own.check_unused()
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue

    return CubeStarBoard(
        scene, onboard_catalogue(pair_limit_deg=WIDEST_PAIR_DEG), baud=rate, layout=chosen, **common
    )


def _open_with(
    own: OwnFirmware,
    scene: "Scene | SkyView",
    *,
    switches: CubeStarSwitches = DEFAULT_SWITCHES,
    **common: Any,
) -> "CubeStarFirmwareBoard":
    """A board that runs an image; raises ValueError for options of the Python program."""
    from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard

    if switches != DEFAULT_SWITCHES:
        raise ValueError("own firmware has no profile and no switches; leave them out")
    common["serial"] = own.serial
    return own.power_up(lambda image: CubeStarFirmwareBoard(scene, image, **common), _shipped)


def _shipped(name: str) -> Path | None:
    if name != REFERENCE:
        return None
    from cubestack.firmware_model.reference.image import reference_image

    return reference_image()


def _load_scene(path: Path) -> "SkyView":
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.mlx75412.lens import CONDITION, UNCERTAIN

    return load_scene(path, CONDITION, UNCERTAIN)


def _scene_form() -> "SceneForm[SkyView]":
    from cubestack.emulator.camera.common.scene_form import sky_form
    from cubestack.emulator.camera.mlx75412.lens import CONDITION, UNCERTAIN

    return sky_form(CONDITION, UNCERTAIN)


def _default_scene() -> "Scene":
    from cubestack.emulator.scene.attitude import quaternion_from_pointing
    from cubestack.emulator.scene.sky import SkyScene

    return SkyScene(quaternion_from_pointing(*POINTING_DEG), mag_limit=MAG_LIMIT)


def _layout_notice(value: str) -> str | None:
    if value == Layout.COPIED.value:
        return None
    from cubestack.emulator.boards.cubestar.layouts import fpga_of

    fpga = fpga_of(Layout(value))
    if fpga.fits:
        return None
    return (
        f"layout {value} can't be built with an AGLN030: its FPGA takes {fpga.pins} "
        f"pins of {fpga.part_pins}, {fpga.tiles} tiles of {fpga.part_tiles}"
    )


DEVICE: "Device[CubeStarStack, CubeStar]" = Device(
    name="cubestar",
    title="CubeStar",
    summary="attitudes of the star tracker",
    interface=INTERFACE,
    client=call("cubestack.host.clients.cubestar.client:CubeStar"),
    open_board=_open_board,
    load_scene=_load_scene,
    scene_form=_scene_form,
    default_scene=_default_scene,
    default_scene_title="Orion",
    experiment=get("cubestack.host.experiments.cubestar.measure:EXPERIMENT"),
    studies={
        "calibrate": get(f"{STUDIES}.calibrate:EXPERIMENT"),
        "bench": get(f"{STUDIES}.benchmark:BENCHMARK"),
        "demo": get(f"{STUDIES}.demo:show"),
        "fidelity": get(f"{STUDIES}.fidelity:FIDELITY"),
        "costs": call(f"{STUDIES}.costs:costs"),
        "campaign": lambda: STUDIES,
    },
    reports=(
        Report(
            "layouts",
            "compare CubeStar's memory layouts: rate, age, power, pins",
            get(f"{STUDIES}.layouts:EXPERIMENT"),
        ),
        Report(
            "catalogue",
            "compile the onboard star catalogue and summarise it",
            get(f"{STUDIES}.catalogue:EXPERIMENT"),
        ),
        Report(
            "memory",
            "list what firmware uses of the processor's memories",
            get(f"{STUDIES}.memory:EXPERIMENT"),
        ),
        Report(
            "upsets",
            "flip bits of FPGA and memories, and report the effects",
            get(f"{STUDIES}.upsets:EXPERIMENT"),
        ),
    ),
    options=(
        BoardOption(
            "layout",
            "memory layout; 1 (default) is the published one, 2 and two-boards its "
            "recommended successors, 3 needs a larger FPGA (docs/layouts.md)",
            choices=tuple(layout.value for layout in Layout),
            default=Layout.COPIED.value,
            notice=_layout_notice,
        ),
        firmware_option(
            f"or {REFERENCE}, the same in C, instead of this project's own",
            known=(REFERENCE,),
            unset="this project's model",
        ),
        *FIRMWARE_OPTIONS,
    ),
    processor=get("cubestack.firmware_model.interface.cubestar.processor_pins:PROCESSOR"),
    tops=get("cubestack.hdl.cubestar.tops:TOPS"),
    proofs=get("cubestack.hdl.proofs.cubestar:PROOFS"),
    contract=get("cubestack.hdl.contract.cubestar.declared:CONTRACT"),
    wirings=get("cubestack.emulator.boards.cubestar.wiring:WIRINGS"),
    image_sensor=REGISTERS,
    conformance=ConformanceNotes(
        effects={
            "StreamDownImage": call(f"{EFFECTS}:check_stream", picture_bytes=IMAGE_BYTES),
            "UploadBlock": call(f"{EFFECTS}:check_upload"),
            "TestWDG": call(f"{EFFECTS}:check_watchdog"),
            "WriteCameraRegister": call(
                f"{EFFECTS}:check_camera_register",
                address=REGISTERS["EXPOSURE"].address + 1,  # its lower byte
            ),
        },
        ended_by={"Trigger": "StopLoop"},
        not_shown=frozenset({"setTrackingMode"}),
        results=frozenset(
            [
                "ExtendedIdentification.ResetCause",
                "TcmdProcessed",
                "TaskStatus",
                "SRAMTestResults",
                "IS_Register",
                "ImageBlock",
                "DetectionThresholdValues.DarkThreshold",
                "DetectionSummary",
                "StarPositions",
                "BodyUnitVectors",
                "NumIdStars",
                "IDStarsDetails",
                "InertialUnitVectors",
                "Quaternion",
                "SphereicalCoordinates",
                "PerformanceParameters",
                "BestStarIndex",
                "Star1Details",
                "Star2Details",
                "Star3Details",
                "LogStatus",
                "Results",
                "StarDetails",
                "AttitudeData",
                "AttitudeQuaternion",
                "HipparcosNumber",
                "UploadStatus",
                "SupplyReport",
                "CameraRegister",
                "LoopStatus",
                "MatchSummary",
                "Quality",
            ]
        ),
    ),
)
