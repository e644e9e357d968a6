"""Same seed and same host bytes at the same virtual times: the same bytes at the same times."""

from dataclasses import replace

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.sky import SkyScene
from tests.system.conftest import Ear, Open, Wire


def run(session: Open, seed: int) -> Wire:
    """Bytes that a board sends in a few captures and turns of the loop, each with its time."""
    scene = SkyView(SkyScene.pointing(84, -1), replace(CONDITION, seed=seed))
    with session(scene, seed=seed) as opened:
        wire = Ear(opened.board.uart).wire
        cubestar, client = opened.client, opened.client.client
        cubestar.capture_and_process()
        cubestar.stars()
        client.telemetry("ImageBlock")
        client.command("Trigger")
        for _ in range(8):
            client.pause(0.1)
            for message in client.interface.telemetries:
                client.request(bytes([message.id]))
    return wire


def test_wire_repeats_to_the_picosecond_and_another_seed_differs(session: Open) -> None:
    first = run(session, 1)
    assert len(first) > 400
    assert run(session, 1) == first
    assert run(session, 2) != first
