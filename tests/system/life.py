"""Some captures of a random CubeStar with random faults, and all that comes of them."""

from collections.abc import Sequence
from io import StringIO

import numpy as np

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.records import start_recorder
from cubestack.host.errors import HostError

LAYOUTS = ("1", "2", "3", "two-boards")
FAULTS_AT_ONCE = 3
LATEST_S = 1.2


def life(
    seed: int,
    *,
    engine: str = "compiled",
    strides: bool = True,
    layouts: Sequence[str] = LAYOUTS,
    gateware: str = "",
    without: str = "",
    kinds: Sequence[str] | None = None,
) -> dict[str, object]:
    """Traffic and final state of a random sky, board and faults.

    Args:
        seed: of everything.
        without: no fault's kind begins so.
        kinds: of the faults; by default three random ones.
    """
    rng = np.random.default_rng(seed)
    scene = SkyScene(random_quaternion(rng), mag_limit=4.0, seed=seed)
    layout = layouts[int(rng.integers(len(layouts)))]
    design = {"gateware": gateware} if gateware else {}
    with open_device(
        "cubestar", scene, seed=seed, engine=engine, layout=layout, **design
    ) as opened:
        opened.board.engine.use_strides(strides)
        recording = StringIO()
        recorder = start_recorder(opened, recording)
        if kinds is None:
            known = [kind for kind, fault in FAULTS.items() if opened.faults.targets(fault.site)]
            known = [kind for kind in known if not (without and kind.startswith(without))]
            kinds = [str(kind) for kind in rng.choice(known, FAULTS_AT_ONCE)]
        opened.faults.seed = seed
        for kind in kinds:
            targets = opened.faults.targets(FAULTS[kind].site)
            target = targets[int(rng.integers(len(targets)))]
            opened.faults.inject(kind, target=target, at_s=float(rng.uniform(0, LATEST_S)))
        client = opened.client.client
        for say, name, seconds in (
            (client.command, "CaptureAndProcess", 0.9),
            (client.telemetry, "ErrorFlags", 0.1),
            (client.telemetry, "DetectionSummary", 0.1),
            (client.command, "CaptureImage", 0.7),
        ):
            try:
                say(name)
            except HostError:
                client.pause(0.05)
            client.pause(seconds)
        recorder.close()
        board = opened.board
        return {
            "recording": recording.getvalue(),
            "memories": [memory.tobytes() for memory in board.sites().all_memories().values()],
            "violations": (board.engine.violations, dict(board.engine.violation_counts)),
            "registers": board.engine.state(),
            "faults": [str(event) for event in opened.faults.log],
            "now": board.kernel.now,
        }


def pair_life(
    seed: int, gateware: str, design: str = "", *, strides: bool = True, upsets: bool = False
) -> dict[str, object]:
    """Traffic and final state of a CubeSense with random poses, memories and faults.

    Args:
        seed: of everything.
        gateware: value of the switch, which the program follows.
        design: files of both FPGAs in place of the shipped ones.
        upsets: faults of the FPGAs' registers too, and their state at the end.
    """
    rng = np.random.default_rng(seed)
    scene = EarthSunScene.facing(
        sun_deg=tuple(rng.uniform(-20, 20, 2)), nadir_deg=tuple(rng.uniform(-15, 15, 2))
    )
    chosen = {"set": f"gateware={gateware}"} | ({"gateware": design} if design else {})
    view = EarthSunView(scene, FisheyeCondition(hot_pixels=20, seed=seed))
    with open_device("cubesense", view, seed=seed, engine="compiled", **chosen) as opened:
        opened.board.engine.use_strides(strides)
        recording = StringIO()
        recorder = start_recorder(opened, recording)
        kinds = [kind for kind, fault in FAULTS.items() if opened.faults.targets(fault.site)]
        kinds = [kind for kind in kinds if upsets or not kind.startswith("register-")]
        opened.faults.seed = seed
        for kind in rng.choice(kinds, FAULTS_AT_ONCE):
            targets = opened.faults.targets(FAULTS[kind].site)
            target = targets[int(rng.integers(len(targets)))]
            opened.faults.inject(str(kind), target=target, at_s=float(rng.uniform(0, LATEST_S)))
        client = opened.client.client
        for camera, sram in zip((0, 1, 0, 1), rng.integers(0, 2, 4).tolist(), strict=True):
            try:
                client.command("CaptureAndDetect", Camera=camera, Sram=sram)
            except HostError:
                client.pause(0.05)
            client.pause(0.4)
        recorder.close()
        board = opened.board
        return {
            # without the header, which names the gateware
            "recording": recording.getvalue().splitlines()[1:],
            "registers": board.engine.state() if upsets else b"",
            "memories": [memory.tobytes() for memory in board.sites().all_memories().values()],
            "violations": (board.engine.violations, dict(board.engine.violation_counts)),
            "now": board.kernel.now,
        }
