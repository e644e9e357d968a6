"""Cost of emulating CubeStar, and of reading it over I2C."""

import subprocess
import sys
import time
from typing import Any

from cubestack.emulator.boards.cubestar.benchmark import (
    rtl_clocks_per_s,
    strides_per_s,
    strobes_per_s,
)
from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.iss.benchmark import instructions_per_s, unicorn_ratios
from cubestack.emulator.rtl.benchmark import cold_build_s
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.devices.device import Device
from cubestack.host.emulation.emulated import EmulatedDevice, power_up
from cubestack.host.studies.bench import LOOP_S, ROUNDS, Benchmark, simulated_ratio

I2C_HZ = 400_000
I2C_CLIENT = """
import time, smbus2
bus = smbus2.SMBus(7)
marks = [time.perf_counter()]
for _ in range(20):
    for _ in range(100):
        bus.read_byte_data(0x1A, 0x83)
    marks.append(time.perf_counter())
times = sorted(after - before for before, after in zip(marks, marks[1:]))
print(100 / times[len(times) // 2])
"""


def _figures(device: Device[CubeStarBoard, CubeStar]) -> dict[str, float]:
    figures: dict[str, float] = {
        "rtl_clocks_per_s": round(rtl_clocks_per_s()),
        "rtl_strides_clocks_per_s": round(strides_per_s()),
        "strobes_per_s": round(strobes_per_s()),
    }
    with power_up(device, SkyScene.pointing(84.0, -1.0), engine="compiled") as emulated:
        figures |= _capture(emulated)
        client = emulated.client.client
        client.command("Trigger")
        client.pause(1.0)
        figures["realtime_ratio"] = simulated_ratio(emulated, lambda: client.pause(float(LOOP_S)))
        client.command("StopLoop")
    figures["instructions_per_s"] = round(instructions_per_s())
    figures |= unicorn_ratios()
    from cubestack.host.studies.cubestar.identification import identification_figures

    figures |= identification_figures()
    figures["firmware_ratio"] = _firmware_ratio(device)
    figures["cold_build_s"] = round(cold_build_s(cubestar_wiring()), 1)
    return figures | _i2c()


def _firmware_ratio(device: Device[CubeStarBoard, CubeStar]) -> float:
    """The 1 Hz loop of the reference firmware on the instruction-set simulator."""
    scene = SkyScene.pointing(84.0, -1.0)
    with power_up(device, scene, engine="compiled", firmware="reference") as emulated:
        client = emulated.client.client
        client.pause(0.2)  # it starts
        client.command("Trigger")
        client.pause(1.0)
        return simulated_ratio(emulated, lambda: client.pause(float(LOOP_S)))


def _capture(emulated: EmulatedDevice[CubeStarBoard, CubeStar]) -> dict[str, float]:
    engine = emulated.board.engine
    strobe_read = engine.strobe_read
    transfer_s = 0.0

    def timed(out: Any, period: Any, until_ps: int) -> int:
        nonlocal transfer_s
        started = time.perf_counter()
        count = strobe_read(out, period, until_ps)
        transfer_s += time.perf_counter() - started
        return count

    engine.strobe_read = timed  # type: ignore[method-assign]
    captures: list[tuple[float, float]] = []
    for _ in range(ROUNDS):
        transfer_s = 0.0
        started = time.perf_counter()
        emulated.client.capture()
        captures.append((time.perf_counter() - started - transfer_s, transfer_s))
    engine.strobe_read = strobe_read  # type: ignore[method-assign]
    return {
        "capture_wall_ms": round(1000 * min(capture for capture, _ in captures), 1),
        "readout_wall_ms": round(1000 * min(transfer for _, transfer in captures), 1),
    }


def _i2c() -> dict[str, float]:
    """Read rates of a program in its own process: median over stretches of 100 reads."""
    figures: dict[str, float] = {}
    command = (sys.executable, "-P", "-m", "cubestack", "run", "--quiet")
    for route in ("seccomp", "preload"):
        for pace in ("fast", "real"):
            options = ("--route", route, "--pace", pace, "--hz", str(I2C_HZ))
            done = subprocess.run(
                [*command, *options, "--", sys.executable, "-P", "-c", I2C_CLIENT],
                stdout=subprocess.PIPE,
                text=True,
            )
            if done.returncode == 0:
                figures[f"i2c_{route}_{pace}"] = round(float(done.stdout))
    return figures


BENCHMARK = Benchmark(
    {
        "rtl_clocks_per_s": "pixel clocks a second through the compiled FPGA, one by one",
        "rtl_strides_clocks_per_s": "the same by the design's proved strides, as it is used",
        "strobes_per_s": "data clocks a second through it, while a picture is read",
        "capture_wall_ms": "wall time of one capture: exposure, read-out, FPGA store",
        "readout_wall_ms": "wall time of one transfer, FPGA's SRAM to processor",
        "realtime_ratio": "simulated seconds per second of processor time of the full 1 Hz loop",
        "instructions_per_s": "of the instruction-set simulator, in an arithmetic loop",
        "unicorn_ratio": "its speed by unicorn's, over nine programs, where unicorn is installed",
        "unicorn_ratio_waits": "the same with the cost of flash wait states, which unicorn lacks",
        "identify_N_ms": "processor time of an identification alone, profile `extended`, with N "
        "false stars",
        "identify_N_ratio": "the time of its Python form by that, in turn in one run",
        "firmware_ratio": "as realtime_ratio, with the reference firmware on the simulator",
        "cold_build_s": "translating and compiling the FPGA with an empty cache",
        "i2c_ROUTE_fast": "byte reads a second of a program below `cubestack run`, by either route",
        "i2c_ROUTE_real": "the same at 400 kHz in the wire's time, which would be 10 256",
    },
    _figures,
)
