"""Draws the diagrams of the documents, into docs/images: `python -m docs.make_diagrams`.

Timing diagrams show runs of the emulated devices: what `--trace` writes, or, where that is too
coarse, what a scope at the FPGA's pins samples. Every run is seeded, so the files repeat to the
byte.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cubestack.emulator.recording.scope import Scope
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.host.cli.hdl.waveform import read
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.records import start_trace
from docs.diagrams.architecture import architecture
from docs.diagrams.blocks import Block, Line, blocks
from docs.diagrams.timing import Lane, levels, timing, values

SEED, ASKED_S, NS, MS = 2, 0.5, 1000, 10**9
"""Of all runs; when the telecommand comes; in ps."""

IMAGES = Path(__file__).parent / "images"


class Run(NamedTuple):
    """Scene file and requests of a device, and how long it is recorded after them."""

    device: str
    command: str
    fields: dict[str, int]
    watched_s: float
    scene: Path | None = None


class View(NamedTuple):
    """What is shown of a device with FPGAs.

    Attributes:
        names: prefix of its memory's pins; variable of the firmware; enable, acknowledge, data
            clock, pixel clock, line and pixels of one camera; level of the enable when it is on.
        step_ms, step_us: between marks of a picture's diagram and of a reading's.
        reading_us: length of the latter.
    """

    names: tuple[str, ...]
    step_ms: int
    step_us: float
    reading_us: int


VIEWS = {
    "cubestar": View(
        ("", "task", "ENABLE", "ACK", "DCLK", "PIXCLK", "HSYNC", "PIXDATA", "1"), 100, 0.5, 4
    ),
    "cubesense": View(
        (
            *("SUN_", "sun_detect", "SUNEN", "SUNACK", "CLK"),
            *("SUN_PCLK", "SUN_HREF", "SUN_Y", "0"),
        ),
        *(10, 2, 20),
    ),
}

CUBESTAR = Run("cubestar", "CaptureImage", {}, 1.0, IMAGES / "sensors" / "grey.toml")
CUBESENSE = Run("cubesense", "CaptureAndDetect", {"Camera": 0, "Sram": 0}, 0.12)


def watched(run: Run, watch: Callable[[Any], Callable[[], None]]) -> None:
    """Do the run with what ``watch`` makes attached to the device."""
    with open_device(run.device, run.scene, seed=SEED) as device:
        close = watch(device)
        client = device.client.client
        client.pause(ASKED_S)
        client.command(run.command, **run.fields)
        client.pause(run.watched_s)
        close()


def traced(run: Run, path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Changes in ps of each variable of the run's VCD file."""
    with path.open("w", encoding="utf-8") as stream:
        watched(run, lambda device: start_trace(device, stream).close)
    changes: dict[str, list[tuple[int, Any]]] = {}
    for time_ps, at_once in read(path, 10**7, internal=True).moments:
        for name, value in at_once.items():
            changes.setdefault(name, []).append((time_ps, value))
    return changes


def seen(run: Run, pins: Sequence[str], start_ps: int, end_ps: int, step_ps: int) -> dict[str, Any]:
    """Changes in ps of pins in a window of the run."""
    scopes = []

    def watch(device: Any) -> Callable[[], None]:
        scopes.append(Scope(device.board.engine, tuple(pins), start_ps, end_ps, step_ps))
        return scopes[0].close

    watched(run, watch)
    return scopes[0].changes


def lanes(changes: dict[str, Any], names: dict[str, str], buses: Sequence[str] = ()) -> list[Lane]:
    """Lanes by the names that they shall have, of variables or pins."""
    return [
        values(name, [(time, f"{value:X}") for time, value in changes[of]])
        if of in buses
        else levels(name, [(time, int(value)) for time, value in changes[of]])
        for name, of in names.items()
    ]


def first(changes: list[tuple[int, Any]], value: object, after_ps: int = 0) -> int:
    """When a variable has ``value`` for the first time after a time."""
    return next(time for time, found in changes if time > after_ps and found == value)


def fpga_diagrams(run: Run, folder: Path) -> dict[str, str]:
    """The diagrams of a sensor with FPGAs: a picture, its last pixels, and its first bytes."""
    view = VIEWS[run.device]
    prefix, words, enable, ack, clock, sync, lines, pixels, on = view.names
    trace = traced(run, folder / f"{run.device}.vcd")
    stored = first(trace[f"fpga.{ack}"], "1")
    reads = first(trace[f"fpga.{enable}"], on, stored)
    whole = {"rx": "uart.rx", "tx": "uart.tx", enable: f"fpga.{enable}", "RNW": "fpga.RNW"}
    start = int(ASKED_S * 1000) * MS - 10 * MS
    last = max(time for time, _ in trace[f"firmware.{words}"])
    picture = [
        *lanes(trace, whole | {ack: f"fpga.{ack}"}),
        values("firmware", trace[f"firmware.{words}"]),
    ]
    storing = {sync: sync, lines: lines, pixels: pixels}
    storing |= {name: f"{prefix}{name}" for name in ("SRAM_A", "SRAM_D_O", "SRAM_WE_N")}
    storing[ack] = ack
    reading = {enable: enable, "RNW": "RNW", "SRAM_OE_N": f"{prefix}SRAM_OE_N"}
    reading |= {"SRAM_A": f"{prefix}SRAM_A", clock: clock, "DATA": "DATA"}
    buses = [pixels, *(f"{prefix}{name}" for name in ("SRAM_A", "SRAM_D_O")), "DATA"]
    before, after = stored - 600 * NS, stored + 300 * NS
    begins, ends = reads - 200 * NS, reads + view.reading_us * 1000 * NS
    pins = seen(run, list(storing.values()), before, after, 5 * NS)
    bytes_ = seen(run, list(reading.values()), begins, ends, 20 * NS)
    return {
        "picture": timing(picture, start, last + 10 * MS, "ms", view.step_ms),
        "pixels": timing(lanes(pins, storing, buses), before, after, "ns", 100),
        "bytes": timing(lanes(bytes_, reading, buses), begins, ends, "us", view.step_us),
    }


def aramis_diagrams() -> dict[str, str]:
    """AraMiS has no FPGA: a frame at the processor's parallel interface, and its first pixels."""
    task: list[tuple[int, object]] = []
    frame: list[tuple[int, int]] = []
    busy: list[tuple[int, int]] = []
    pixels: dict[str, str] = {}
    with open_device("aramis", seed=SEED) as device:
        client, board = device.client.client, device.board
        client.command("Activate")
        client.pause(2)
        start = board.kernel.now
        client.command("GetAttitude")
        while board.kernel.now < start + 400 * MS:
            now, segment = board.kernel.now, board.camera.segment_at(board.kernel.now)
            task.append((now, board.probes()["task"]))
            frame.append((now, segment.vsync if segment else 0))
            busy.append((now, int(board.ppi.busy)))
            if segment and segment.rows > 1 and not pixels:
                pixels["pixels"] = first_pixels(LoadedSegment.of(board.camera, segment))
            client.pause(0.0005)
    changed = [
        one for one, before in zip(task, [(0, ""), *task], strict=False) if one[1] != before[1]
    ]
    whole = [levels("FRAME_VALID", frame), levels("PPI busy", busy), values("firmware", changed)]
    return {"picture": timing(whole, start, start + 400 * MS, "ms", 50), **pixels}


def first_pixels(loaded: LoadedSegment) -> str:
    """The first clocks of a frame's first line."""
    loaded.pixels = loaded.render() if loaded.pixels is None else loaded.pixels
    clock, line, data = [], [], []
    begin = loaded.time_of(0) - int(4 * loaded.half_period)
    for n in range(12):
        valid, pixel = loaded.sample(n)
        clock += [(loaded.time_of(2 * n), 1), (loaded.time_of(2 * n + 1), 0)]
        line.append((loaded.time_of(2 * n), valid))
        data.append((loaded.time_of(2 * n), f"{pixel:X}"))
    return timing(
        [
            levels("PIXCLK", [(begin, 0), *clock]),
            levels("LINE_VALID", [(begin, 0), *line]),
            values("DATA", [(begin, ""), *data]),
        ],
        begin,
        loaded.time_of(20),
        "ns",
        50,
    )


BLOCKS = {
    "cubestar": blocks(
        {
            "camera": Block(0, 0, "MLX75412", "image sensor"),
            "fpga": Block(1, 0, "IGLOO nano", "FPGA, frame buffer"),
            "mcu": Block(2, 0, "EFM32GG", "microcontroller"),
            "host": Block(3, 0, "host", "on-board computer"),
            "sram": Block(1, 1, "SRAM", "a whole image"),
            "ram": Block(2, 1, "RAM", "the working copy"),
        },
        [
            Line("camera", "fpga", "PIXDATA, PIXCLK\nHSYNC, VSYNC"),
            Line("fpga", "mcu", "ACK, DATA\nENABLE, RNW, DCLK", both=True),
            Line("mcu", "host", "UART\nI2C", both=True),
            Line("fpga", "sram", "address,\ndata", both=True),
            Line("mcu", "ram", "external\nbus", both=True),
        ],
    ),
    "cubesense": blocks(
        {
            "sun": Block(0, 1, "OV7620", "Sun camera"),
            "nadir": Block(0, 2, "OV7620", "nadir camera"),
            "sun sram": Block(1, 0, "SRAM", "an image"),
            "sun fpga": Block(1, 1, "FPGA", "of the Sun camera"),
            "nadir fpga": Block(1, 2, "FPGA", "of the nadir camera"),
            "nadir sram": Block(1, 3, "SRAM", "an image"),
            "mcu": Block(2, 1, "PIC18F45K20", "microcontroller", rows=2),
            "host": Block(3, 1, "host", "on-board computer", rows=2),
        },
        [
            Line("sun", "sun fpga", "Y, PCLK\nHREF"),
            Line("nadir", "nadir fpga", "Y, PCLK\nHREF"),
            Line("sun fpga", "sun sram", "address,\ndata", both=True),
            Line("nadir fpga", "nadir sram", "address,\ndata", both=True),
            Line("sun fpga", "nadir fpga", "link: each can use\nthe other's SRAM", both=True),
            Line("sun fpga", "mcu", "DATA, SUNACK\nSUNEN, CLK", both=True),
            Line("nadir fpga", "mcu", "DATA, NADACK\nNADEN, CLK", both=True),
            Line("mcu", "host", "two UARTs\nI2C", both=True),
        ],
    ),
    "aramis": blocks(
        {
            "flash": Block(1, 0, "flash", "star catalogue"),
            "camera": Block(0, 1, "MT9M001", "image sensor"),
            "mcu": Block(1, 1, "Blackfin", "processor, PPI, DMA"),
            "host": Block(2, 1, "host", "on-board computer"),
            "sdram": Block(1, 2, "SDRAM", "images, catalogue"),
        },
        [
            Line("flash", "mcu", "bytes of the\ncoded catalogue"),
            Line("camera", "mcu", "pixels, PIXCLK\nFRAME_, LINE_VALID"),
            Line("mcu", "host", "UART\nI2C", both=True),
            Line("mcu", "sdram", "DMA of whole frames,\nprogram", both=True),
        ],
    ),
}


def diagrams(folder: Path) -> dict[str, str]:
    """All of them, by the name of their file; traces are kept in ``folder``."""
    made = {f"{name}-blocks": text for name, text in BLOCKS.items()}
    for run in (CUBESTAR, CUBESENSE):
        found = fpga_diagrams(run, folder)
        made |= {f"{run.device}-{name}": text for name, text in found.items()}
    made |= {f"aramis-{name}": text for name, text in aramis_diagrams().items()}
    return {f"{name}.svg": text for name, text in made.items()}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=IMAGES / "sensors")
    parser.add_argument("--traces", type=Path, default=Path("out"), help="folder of the VCD files")
    chosen = parser.parse_args()
    for kept in (chosen.out, chosen.traces):
        kept.mkdir(parents=True, exist_ok=True)
    (IMAGES / "architecture.svg").write_text(architecture(), encoding="utf-8")
    for file, text in diagrams(chosen.traces).items():
        (chosen.out / file).write_text(text, encoding="utf-8")
        print(chosen.out / file)
