"""Compare CubeStar's memory layouts: each runs its loop on the same sky in virtual
time and is measured over its ports.

rate       attitudes per second
age        from the mid-exposure of an image until telemetry has its attitude, and
           the maximum, just before the next attitude
power      mean of the whole stack at 3.3 V, with its two LEDs
energy     per attitude
pins       of each FPGA, of the AGLN030's 77
tiles      of each FPGA, as in hdl/cubestar/area.json

examples:
  cubestack layouts
  cubestack layouts --seconds 60 --json
  cubestack measure cubestar --layout 2 --json     one shot, with its phases
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.layouts import BOARDS, fpga_of
from cubestack.firmware_model.cubestar.state import ATTITUDE_PAGE, Attitude
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.values import whole
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.attitude import errors, is_right
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.options import Options, file_option

SETTLING = 2
"""Attitudes before the measurement."""

PS_PER_MS, PS_PER_S = 10**9, 10**12
MIDDLE_ROW = 255.5

#: CubeStar thesis, sections 3.3, 5.3.6, 6.3 and 7.2; shown beside ours. Fitted are power and copy.
PUBLISHED = {
    Layout.COPIED: "1 Hz, age 1.5 s, 396 mW; copy 404 ms",
    Layout.SHARED: "1 Hz, age below 1 s; no copy",
    Layout.TWO_MEMORIES: "2 Hz; no copy; too many pins",
    Layout.TWO_BOARDS: "2 Hz; no copy",
}


@dataclass(frozen=True)
class LayoutResult(Result):
    """Measurements of a layout; the attributes are those of the JSON output.

    Rate, age and energy are None without attitudes.
    """

    layout: str
    fpgas: int
    pins: int
    tiles: int
    fits: bool
    attitudes: int  #: counted
    right: int | None  #: number of right ones; None if the scene has no truth
    rate_hz: float | None
    age_ms: float | None  #: mean, when an attitude becomes available
    oldest_ms: float | None  #: mean, just before the next one
    power_mw: float | None
    energy_mj: float | None
    phase_ms: dict[str, float]  #: the program's own times of the last turn
    violations: int  #: broken rules of the memories and wires
    published: str


@dataclass(frozen=True, kw_only=True)
class LayoutOptions(Options):
    """Options of `cubestack layouts`."""

    scene: Any = file_option(None, "TOML scene; default: Orion, V < 3.8")
    seconds: int = whole(10, "of virtual time each (default 10)", 2, 3600)
    seed: int = whole(0, "seed of everything random (default 0)", 0)


class _Layouts(Experiment["CubeStarOpener", LayoutOptions, LayoutResult]):
    options = LayoutOptions
    description = __doc__
    title = "CubeStar's memory layouts in their loops"
    columns = ("layout", "Hz", "age ms", "mW", "mJ", "copy ms", "pins", "tiles")
    label = "running"
    decides = ("layout",)

    def count(self, options: LayoutOptions) -> int:
        return len(Layout)

    def run(self, opened: CubeStarOpener, options: LayoutOptions) -> Iterator[LayoutResult]:
        for layout in Layout:
            yield measure_layout(layout, opened, options)

    def row(self, number: int, result: LayoutResult) -> tuple[str, ...]:
        each = f"{result.fpgas} x " if result.fpgas > 1 else ""
        return (
            result.layout,
            _shown(result.rate_hz, 2),
            f"{_shown(result.age_ms)} to {_shown(result.oldest_ms)}",
            _shown(result.power_mw),
            _shown(result.energy_mj),
            f"{result.phase_ms['transfer']:.0f}",
            f"{each}{result.pins}{'' if result.fits else ' (!)'}",
            f"{each}{result.tiles}",
        )

    def summarise(self, results: Sequence[LayoutResult], wall_s: float) -> Iterator[str]:
        for result in results:
            yield f"published for {result.layout}: {result.published}"
        for result in results:
            if not result.fits:
                yield f"(!) layout {result.layout} can't be built: an AGLN030 has 77 pins"

    def succeeded(self, results: Sequence[LayoutResult]) -> bool:
        return all(result.attitudes for result in results)


def _shown(value: float | None, digits: int = 0) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def measure_layout(layout: Layout, opened: CubeStarOpener, options: LayoutOptions) -> LayoutResult:
    """Run the loop of ``layout`` for ``seconds`` of virtual time after settling."""
    with opened(options.scene, seed=options.seed, layout=layout.value) as emulated:
        emulated.client.client.command("Trigger")
        found = list(attitudes_of_loop(emulated.board, options.seconds))
        emulated.client.client.command("StopLoop")
        phases = emulated.client.phase_times()
        violations = sum(emulated.board.engine.violation_counts.values())
        volts = emulated.board.power.table.volts
    fpga = fpga_of(layout)
    # Without an attitude there is nothing to divide by.
    begun, measured = found[0], found[1:]
    count = len(measured)
    took_s = (found[-1].time_ps - begun.time_ps) / PS_PER_S if count else math.nan
    age_ms = sum(one.age_ms for one in measured) / count if count else math.nan
    spent_mj = (found[-1].charge_mas - begun.charge_mas) * volts if count else math.nan
    return LayoutResult(
        layout=layout.value,
        fpgas=len(BOARDS[layout].boards),
        pins=fpga.pins,
        tiles=fpga.tiles,
        fits=fpga.fits,
        attitudes=count,
        right=None if begun.right is None else sum(bool(one.right) for one in measured),
        rate_hz=_known(count / took_s, 3),
        age_ms=_known(age_ms),
        oldest_ms=_known(age_ms + 1000 * took_s / max(count, 1)),
        power_mw=_known(spent_mj / took_s),
        energy_mj=_known(spent_mj / max(count, 1)),
        phase_ms={name: round(value, 1) for name, value in phases.items()},
        violations=violations,
        published=PUBLISHED[layout],
    )


def _known(value: float, digits: int = 1) -> float | None:
    return None if math.isnan(value) else round(value, digits)


@dataclass(frozen=True)
class Found:
    """An attitude when it becomes available."""

    time_ps: int
    charge_mas: float
    age_ms: float
    right: bool | None


def attitudes_of_loop(board: CubeStarBoard, seconds: int) -> Iterator[Found]:
    """Attitudes after the first ``SETTLING``: one, and those of the next ``seconds``.

    If the first does not come, only its time is returned.
    """
    kernel, seen, end_ps = board.kernel, 0, board.kernel.now + (SETTLING + 3) * PS_PER_S
    begun = False
    while not begun or kernel.now < end_ps:
        if kernel.now >= end_ps:
            yield Found(kernel.now, 0.0, math.nan, right=None)
            return
        kernel.step()
        writes = board.flash.writes.get(ATTITUDE_PAGE, 0)
        if writes == seen:
            continue
        seen = writes
        if seen <= SETTLING:
            continue
        page, stored, truth = board.flash.read(ATTITUDE_PAGE), board.stored[-1], board.truth()
        assert page is not None
        assert stored is not None
        right = None
        if truth is not None:
            right = is_right(*errors(Attitude.unpack(page).quaternion, truth))
        if not begun:
            begun, end_ps = True, kernel.now + seconds * PS_PER_S + PS_PER_MS
        yield Found(
            kernel.now,
            board.power.charge_mas(),
            (kernel.now - stored.mid_exposure_ps(MIDDLE_ROW)) / PS_PER_MS,
            right=right,
        )


SLOWER = 6
"""Register of a frame rate at which two images per second are too many."""


def turns(opened: CubeStarOpener, seconds: int) -> dict[str, float]:
    """Of the loop with two memories: its frames in ms, how long the camera is on in %, its rate
    with a slower camera, and whether it then reports an error; transactions of the shared memory
    while stars are found in Orion."""
    with opened(None, seed=0, layout=Layout.TWO_MEMORIES.value) as emulated:
        client = emulated.client.client
        client.command("Trigger")
        begun, *found = attitudes_of_loop(emulated.board, seconds)
        phases = emulated.client.phase_times()
        figures = {name: phases[name] for name in ("discard", "capture")}
        figures["camera"] = sum(figures.values()) * _rate_hz(begun, found) / 10
        client.command("SetFrameRate", FrameRate=SLOWER)
        begun, *found = attitudes_of_loop(emulated.board, seconds)
        phases = emulated.client.phase_times()
        figures["slower"] = phases["discard"] + phases["capture"]
        figures["slower hz"] = _rate_hz(begun, found)
        figures["slower late"] = bool(client.telemetry("ErrorFlags")["TimingError"])
    with opened(None, seed=0, layout=Layout.SHARED.value) as emulated:
        before = emulated.board.processor.meter.counts.copy()
        emulated.client.capture_and_process()
        spent = emulated.board.processor.meter.counts - before
        figures |= {name: spent[f"ebi_{name[:-1]}"] for name in ("reads", "writes")}
    return figures


def _rate_hz(begun: Found, found: Sequence[Found]) -> float:
    return len(found) * PS_PER_S / (found[-1].time_ps - begun.time_ps)


EXPERIMENT = _Layouts()
