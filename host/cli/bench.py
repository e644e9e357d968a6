"""Measure the cost of the hot paths on this machine, on one core.

rtl_clocks_per_s  pixel clocks a second through the compiled FPGA, none skipped
strobes_per_s     data clocks a second through it, while a picture is read
capture_wall_ms   wall time of one capture: exposure, read-out, FPGA store
readout_wall_ms   wall time of one transfer, FPGA's SRAM to processor
realtime_ratio    simulated seconds per wall second of the full 1 Hz loop
cold_build_s      translating and compiling the FPGA with an empty cache
sensors_ratio     as realtime_ratio, CubeSense with both cameras once a second
pair_own_ms       CubeSense: one frame to the own camera's memory
pair_linked_ms    CubeSense: one frame across the link
pair_both_ms      CubeSense: both frames at once
pair_scan_ms      CubeSense: one nadir scan, SRAM to microcontroller
pair_build_s      as cold_build_s, both of CubeSense's FPGAs
aramis_ratio      as realtime_ratio, AraMiS, lost in space with verification
aramis_frame_ms   AraMiS: rendering one frame with all its stars and noise
aramis_solve_ms   AraMiS: one solve, from the picture to the attitude
i2c_ROUTE_fast    byte reads a second of a program below `cubestack run`, by either route
i2c_ROUTE_real    the same at 400 kHz in the wire's time, which would be 10 256

What compares the engines that can run the FPGA designs is `make bench-engines` (docs/engines.md).
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.aramis import MeasurementMode
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.cli.aramis_session import aramis_catalogue, open_aramis
from cubestack.host.cli.session import open_cubesense, open_session
from cubestack.host.cli.terminal import console

if TYPE_CHECKING:
    from cubestack.host.cli.session import CubeSenseSession, Session

__all__ = ["add_arguments", "run"]

LOOP_ITERATIONS = 10
CAPTURES = 5
HIGHEST_GAIN = 15.0
PS_PER_S = 10**12
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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    """Measure and report."""
    from cubestack.emulator.boards.cubesense.benchmark import (
        STORES,
        pair_scan_ms,
        pair_store_ms,
        pair_with_cameras,
    )
    from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
    from cubestack.emulator.boards.cubestar.benchmark import rtl_clocks_per_s, strobes_per_s
    from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
    from cubestack.emulator.rtl.benchmark import cold_build_s
    from cubestack.emulator.scene.attitude import quaternion_from_pointing
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.emulator.scene.sky import SkyScene

    figures: dict[str, float] = {
        "rtl_clocks_per_s": round(rtl_clocks_per_s()),
        "strobes_per_s": round(strobes_per_s()),
    }
    scene = SkyScene(quaternion=quaternion_from_pointing(84.0, -1.0, 0.0))
    with open_session(scene, engine="compiled") as session:
        figures |= _capture(session)
        figures["realtime_ratio"] = round(_realtime_ratio(session), 2)
    with open_cubesense(EarthSunScene(), engine="compiled") as sensors:
        figures["sensors_ratio"] = round(_sensors_ratio(sensors), 2)
    figures["cold_build_s"] = round(cold_build_s(cubestar_wiring()), 1)
    for way in STORES:
        figures[f"pair_{way}_ms"] = round(pair_store_ms(pair_with_cameras(), way), 1)
    figures["pair_scan_ms"] = round(pair_scan_ms(pair_with_cameras()), 1)
    figures["pair_build_s"] = round(cold_build_s(cubesense_wiring()), 1)
    figures |= _aramis()
    figures |= _i2c()
    if args.json:
        print(json.dumps(figures))
        return 0
    for name, value in figures.items():
        console.print(f"{name:>18}  {value:,}")
    return 0


def _capture(session: "Session") -> dict[str, float]:
    """Wall times of capture and transfer: best of several, as the rest is the machine's noise."""
    engine = session.board.engine
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
    for _ in range(CAPTURES):
        transfer_s = 0.0
        started = time.perf_counter()
        session.cubestar.capture()
        captures.append((time.perf_counter() - started - transfer_s, transfer_s))
    engine.strobe_read = strobe_read  # type: ignore[method-assign]
    return {
        "capture_wall_ms": round(1000 * min(capture for capture, _ in captures), 1),
        "readout_wall_ms": round(1000 * min(transfer for _, transfer in captures), 1),
    }


def _realtime_ratio(session: "Session") -> float:
    client, kernel = session.cubestar.client, session.board.kernel
    client.command("Trigger")
    client.pause(1.0)
    virtual, wall = kernel.now, time.perf_counter()
    client.pause(float(LOOP_ITERATIONS))
    ratio = (kernel.now - virtual) / PS_PER_S / (time.perf_counter() - wall)
    client.command("StopLoop")
    return ratio


def _aramis() -> dict[str, float]:
    """The loop of the third sensor, and the wall times of what it spends them on."""
    from cubestack.emulator.camera.common.register_file import RegisterFile
    from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
    from cubestack.emulator.camera.mt9m001.lens import CONDITION
    from cubestack.emulator.camera.mt9m001.registers import read_settings
    from cubestack.emulator.scene.sky import SkyScene
    from cubestack.firmware_model.aramis.detection.background import Background
    from cubestack.firmware_model.aramis.pipeline import VERIFIED, solve
    from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
    from cubestack.firmware_model.mcu.costs import Meter

    database = aramis_catalogue()
    scene = SkyScene.pointing(84.0, -1.0)
    with open_aramis(scene) as session:
        session.aramis.activate()
        client, kernel = session.aramis.client, session.board.kernel
        client.command("StartLoop", Period=1000, Mode=MeasurementMode.LOST_IN_SPACE)
        client.pause(2.0)
        virtual, wall = kernel.now, time.perf_counter()
        client.pause(float(LOOP_ITERATIONS))
        ratio = (kernel.now - virtual) / PS_PER_S / (time.perf_counter() - wall)
        client.command("StopLoop")
        frames: list[float] = []
        imager = Mt9m001Imager()
        settings = replace(read_settings(RegisterFile(REGISTERS)), gains=(HIGHEST_GAIN,) * 4)
        shutter = session.board.ppi.stored
        assert shutter is not None
        for _ in range(CAPTURES):
            started = time.perf_counter()
            picture = imager.picture(scene, CONDITION, shutter, settings)
            frames.append(time.perf_counter() - started)
    solves: list[float] = []
    for _ in range(CAPTURES):
        started = time.perf_counter()
        solve(picture, Background(), VERIFIED, database, Meter(BLACKFIN_BF533))
        solves.append(time.perf_counter() - started)
    return {
        "aramis_ratio": round(ratio, 2),
        "aramis_frame_ms": round(1000 * min(frames), 1),
        "aramis_solve_ms": round(1000 * min(solves), 1),
    }


def _i2c() -> dict[str, float]:
    """Rates of a program in a process of its own: the median of stretches of 100 reads."""
    figures: dict[str, float] = {}
    command = (sys.executable, "-m", "cubestack.host.cli.main", "run", "--quiet")
    for route in ("seccomp", "preload"):
        for pace in ("fast", "real"):
            options = ("--route", route, "--pace", pace, "--hz", str(I2C_HZ))
            done = subprocess.run(
                [*command, *options, "--", sys.executable, "-c", I2C_CLIENT],
                stdout=subprocess.PIPE,
                text=True,
            )
            if done.returncode == 0:
                figures[f"i2c_{route}_{pace}"] = round(float(done.stdout))
    return figures


def _sensors_ratio(sensors: "CubeSenseSession") -> float:
    """Each second a host reads both results, which starts the next measurements."""
    client, kernel = sensors.cubesense.client, sensors.board.kernel

    def turn() -> None:
        due = kernel.now + PS_PER_S
        for camera in Camera:
            sensors.cubesense.result_then_schedule(camera)
        client.pause((due - kernel.now) / PS_PER_S)

    client.pause(0.5)
    turn()
    virtual, wall = kernel.now, time.perf_counter()
    for _ in range(LOOP_ITERATIONS):
        turn()
    return (kernel.now - virtual) / PS_PER_S / (time.perf_counter() - wall)
