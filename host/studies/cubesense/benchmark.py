"""Cost of emulating CubeSense."""

from cubestack.emulator.boards.cubesense import benchmark
from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.rtl.benchmark import cold_build_s
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.devices.device import Device
from cubestack.host.emulation.emulated import power_up
from cubestack.host.studies.bench import LOOP_S, Benchmark, simulated_ratio


def _figures(device: Device[CubeSenseBoard, CubeSense]) -> dict[str, float]:
    figures = {"sensors_ratio": _loop_ratio(device)}
    for way in benchmark.STORES:
        stored_ms = benchmark.pair_store_ms(benchmark.pair_with_cameras(), way)
        figures[f"pair_{way}_ms"] = round(stored_ms, 1)
    figures["pair_scan_ms"] = round(benchmark.pair_scan_ms(benchmark.pair_with_cameras()), 1)
    figures["pair_build_s"] = round(cold_build_s(cubesense_wiring()), 1)
    return figures


def _loop_ratio(device: Device[CubeSenseBoard, CubeSense]) -> float:
    """A host reads both results each second, which starts the next measurements."""
    with power_up(device, EarthSunScene(), engine="compiled") as emulated:
        client = emulated.client.client

        def turns(count: int) -> None:
            for _ in range(count):
                due_s = emulated.time_s + 1
                for camera in Camera:
                    emulated.client.result_then_schedule(camera)
                client.pause(due_s - emulated.time_s)

        client.pause(0.5)
        turns(1)
        return simulated_ratio(emulated, lambda: turns(LOOP_S))


BENCHMARK = Benchmark(
    {
        "sensors_ratio": "as realtime_ratio, with both cameras once a second",
        "pair_own_ms": "one image to the own camera's memory",
        "pair_linked_ms": "one image across the link",
        "pair_both_ms": "both images at once",
        "pair_scan_ms": "one nadir scan, SRAM to microcontroller",
        "pair_build_s": "as cold_build_s, both FPGAs",
    },
    _figures,
)
