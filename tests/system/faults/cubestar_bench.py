"""What the tests of a CubeStar's pictures share."""

from typing import Any

import numpy as np

from cubestack.firmware_model.interface.cubestar.codes import ImageBlockSize

from .bench import Bench

FAILED = ("CAPTURE_FAILED", {"ImageCaptureError"})
GOOD = ("CALCULATED", set[str]())
"""Of a capture: how far it and its processing came, and the flags."""

ROWS, COLUMNS = 512, 1024
STORING_S, READING_S = 0.42, 0.6
"""Within the first capture after power-up, which stores one frame."""

ONE_FRAME_MS, TWO_FRAMES_MS = 384.0, 770.0
"""How long a first capture stores, when the FPGA keeps the first whole frame, or the second."""


def stored(bench: Bench) -> np.ndarray:
    """What the FPGA wrote into its memory, (512, 1024)."""
    memory: np.ndarray = bench.board.engine.sram[: ROWS * COLUMNS]
    return memory.reshape(ROWS, COLUMNS).copy()


def transferred(bench: Bench) -> np.ndarray:
    """What the processor read of it, (512, 1024)."""
    memory: np.ndarray = bench.board.program._capture.pictures.image
    return memory.copy()


def block(bench: Bench, number: int) -> np.ndarray:
    """128 bytes of the picture as the host gets them."""
    size = ImageBlockSize.BYTES_128
    bench.client.command("ImageBlockSet", BlockNumber=number, BlockSize=size)
    bench.client.wait_processed(1.0)
    return np.frombuffer(bench.telemetry("ImageBlock")["Block"], np.uint8)


def capture(bench: Bench) -> tuple[str, set[str]]:
    """How far a capture and its processing came, and the flags."""
    status = bench.device.capture_and_process().name
    return status, bench.flags()


def capture_with(bench: Bench, kind: str, **options: Any) -> tuple[str, set[str]]:
    """The same with a fault, which is cleared then."""
    status, flags = bench.during(kind, lambda: capture(bench), **options)
    return status, flags


def stored_for_ms(bench: Bench) -> float:
    """How long the FPGA stored in the latest capture."""
    return float(bench.device.phase_times()["capture"])
