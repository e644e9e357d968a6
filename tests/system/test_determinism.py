"""Same seed and same host bytes at the same virtual times: the same bytes at the same times."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.sky import SkyScene

Wire = list[tuple[bytes, int, int]]


def run(session: Callable[..., Any], seed: int) -> Wire:
    """Bytes that a board sends in a few captures and turns of the loop, each with its time."""
    scene = SkyView(SkyScene.pointing(84, -1), replace(CONDITION, seed=seed))
    with session(scene, seed=seed) as opened:
        wire: Wire = []
        cubestar, client = opened.client, opened.client.client
        deliver = opened.board.uart.line

        def listen(data: bytes, first_ps: int, byte_ps: int) -> None:
            wire.append((bytes(data), first_ps, byte_ps))
            deliver(data, first_ps, byte_ps)

        opened.board.uart.line = listen
        cubestar.capture_and_process()
        cubestar.stars()
        client.telemetry("ImageBlock")
        client.command("Trigger")
        for _ in range(8):
            client.pause(0.1)
            for message in client.interface.telemetries:
                client.request(bytes([message.id]))
    return wire


def test_wire_repeats_to_the_picosecond(session: Callable[..., Any]) -> None:
    first = run(session, 1)
    assert len(first) > 400
    assert run(session, 1) == first


def test_another_seed_is_another_run(session: Callable[..., Any]) -> None:
    assert run(session, 1) != run(session, 2)
