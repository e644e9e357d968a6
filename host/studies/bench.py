"""Measure the cost of the hot paths on this machine, on one core."""

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from cubestack.host.cli.arguments import add_flag
from cubestack.host.devices.registry import devices
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.studies.ratios import MEANINGS, device_ratios, light_ratio
from cubestack.host.terminal import busy, tell


@dataclass(frozen=True)
class Benchmark:
    """Measures the cost of emulating a device."""

    figures: Mapping[str, str]  #: meaning of each figure, by its name in the JSON output
    #: measures a device: figures by name, without those that can't be measured here
    run: Callable[[Any], Mapping[str, float]]


LOOP_S = 10
"""Virtual time over which a loop is measured."""

ROUNDS = 5
"""Repetitions of short measurements: the best counts, the rest is noise of the machine."""


def simulated_ratio(emulated: AnyEmulated, run: Callable[[], None]) -> float:
    """Virtual time by processor time, which on an idle machine is wall time."""
    virtual_s, began_s = emulated.time_s, time.process_time()
    run()
    return round((emulated.time_s - virtual_s) / (time.process_time() - began_s), 2)


def best_ms(run: Callable[[], object]) -> float:
    """Wall time of ``run`` in ms, the best of ``ROUNDS``."""
    times = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return round(1000 * min(times), 1)


COMPARISON = "`make bench-engines` compares the engines that run the FPGA designs."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option, with the meaning of each figure."""
    add_flag(parser, "--json", "print one JSON object")
    lines = [
        f"{name:<17} {device.title}: {meaning}"
        for device in devices()
        if (benchmark := device.study("bench"))
        for name, meaning in benchmark.figures.items()
    ]
    lines += [f"{name:<17} {meaning}" for name, meaning in MEANINGS.items()]
    parser.epilog = "\n".join([*lines, "", f"{COMPARISON} (docs/engines.md)"])


def run(args: argparse.Namespace) -> int:
    figures = light_ratio()
    for device in devices():
        if benchmark := device.study("bench"):
            with busy(f"measuring {device.title}", quiet=args.json):
                figures |= benchmark.run(device) | device_ratios(device.name)
    if args.json:
        print(json.dumps(figures))
        return 0
    for name, value in figures.items():
        tell(f"{name:>18}  {value:,}")
    return 0
