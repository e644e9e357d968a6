"""Cost of CubeStar's program as compiled code: operations, and the phases of one image."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.boards.cubestar.compiled.build import (
    Build,
    compile_program,
    compiler_version,
)
from cubestack.emulator.boards.cubestar.compiled.machine import (
    Timing,
    operation_cycles,
    start_program,
)
from cubestack.emulator.boards.cubestar.compiled.picture import default_settings, run, run_model
from cubestack.emulator.camera.common.image_sensor import StarSensor
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3, FILE, cortex_m3, load_measurements
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import power_up
from cubestack.host.studies.costs import CostMeasurement, CostReport
from cubestack.host.studies.cubestar.reference_catalogue import catalogue_tables

PUBLISHED_MS = 320.0
"""Detection and matching of 20 centroids: CubeStar thesis, figure 5.7."""

#: Right ascension and declination in degrees, and faintest magnitude, of an image with the
#: published 20 centroids.
POINTING_DEG, MAG_LIMIT = (84.0, -1.0), 4.5

_BUILDS = tuple((f"O{level}", kind) for kind in ("own", "float", "literals", "double")
                for level in ("0", "2", "s"))  # fmt: skip
#: Further wait states of the memories, for the slowest and the fastest build.
_TIMINGS: tuple[dict[str, Any], ...] = (
    {"flash_waits": 0},
    {"cache": False},
    {"bus": (3, 3, 15, 3)},
    {"cache": False, "bus": (3, 3, 15, 3)},
)

#: Columns of the table, with the phases in each.
COLUMNS = {
    "search": ("search",),
    "centroids to vectors": ("centroid", "correction", "vectors"),
    "distances": ("distances",),
    "votes": ("votes",),
    "identities, selection": ("identities", "selection"),
    "verification": ("verification",),
}


@dataclass(frozen=True)
class _Case:
    build: Build
    timing: Timing


def _cases(levels: Sequence[str], precisions: Sequence[str]) -> Iterator[_Case]:
    chosen = [Build(*b) for b in _BUILDS if b[0] in levels and b[1] in precisions]
    for build in chosen:
        yield _Case(build, Timing())
    for build in chosen:
        if build in (Build("O2", "own"), Build("O0", "double")):
            for waits in _TIMINGS:
                yield _Case(build, Timing(**waits))


def picture(scene: SkyScene | None = None) -> NDArray[np.uint8]:
    """The image to process, as the emulated camera captures it; the default has 20 centroids."""
    scene = scene or replace(SkyScene.pointing(*POINTING_DEG), mag_limit=MAG_LIMIT)
    with power_up(device("cubestar"), scene) as emulated:
        emulated.client.take_picture()
        camera = getattr(emulated.board, "camera", None)
        assert isinstance(camera, StarSensor)
        assert camera.rendered is not None
        return camera.rendered


def generated() -> dict[str, str]:
    """Sources and headers of the measuring program, generated from tables."""
    return {**catalogue_tables(), "defaults.h": default_settings(), "efm32gg.h": c_header(LAYOUTS)}


def measure(levels: Sequence[str], precisions: Sequence[str]) -> Iterator[CostMeasurement]:
    compiler_version()
    pixels, sources, images = picture(), generated(), {}
    for case in _cases(levels, precisions):
        if case.build not in images:
            images[case.build] = compile_program(case.build, sources)
        calls = start_program(images[case.build], case.timing)
        phases = run(calls, pixels).cycles
        cycles = operation_cycles(calls, double=case.build.precision == "double")
        calls.machine.close()
        yield CostMeasurement(str(case.build), str(case.timing), cycles, phases)


def page(found: Sequence[CostMeasurement], clock_hz: int) -> str:
    """The table of builds in ms, beside the Python program's charges and the published times."""
    lines = [
        f"| build | memory | {' | '.join(COLUMNS)} | sum, ms |",
        "|-" * (len(COLUMNS) + 3) + "|",
    ]
    load_measurements.cache_clear()  # the file may have been written just now
    charges = run_model(picture(), onboard_catalogue(), Meter(cortex_m3())).cycles
    rows: list[tuple[str, str, Mapping[str, int]]] = [
        ("charged by the Python program", "its own table", charges),
        *((f"`{one.build}`", one.timing, one.phases) for one in found),
    ]
    for name, memory, phases in rows:
        times = [1000 * sum(phases[p] for p in group) / clock_hz for group in COLUMNS.values()]
        shown = " | ".join(f"{ms:.1f}" for ms in times)
        lines.append(f"| {name} | {memory} | {shown} | {sum(times):.0f} |")
    lines.append(f"| published | | {' | ' * (len(COLUMNS) - 1)} | {PUBLISHED_MS:.0f} |")
    return "\n".join(lines)


def as_data(found: Sequence[CostMeasurement]) -> dict[str, Any]:
    return {"compiler": compiler_version(), "builds": [asdict(one) for one in found]}


def _file() -> Any:
    return FILE


def _defaults() -> Mapping[str, float]:
    return {name: cost.cycles for name, cost in CORTEX_M3.operations.items()}


def costs() -> CostReport:
    return CostReport(
        levels=("O0", "O2", "Os"),
        precisions=("own", "float", "literals", "double"),
        measure=measure,
        as_data=as_data,
        file=_file(),
        page=lambda found: page(found, CORTEX_M3.clock_hz),
        document="fidelity.md",
        table=_defaults(),
    )
