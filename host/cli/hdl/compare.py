"""`cubestack hdl compare`."""

import argparse
import json
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from cubestack.firmware_model.values import number, whole
from cubestack.host.cli.arguments import add_flag, add_output, add_value
from cubestack.host.cli.device_options import add_board_arguments, chosen_options
from cubestack.host.cli.hdl.design import fpga_wiring
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices
from cubestack.host.output import Outputs, output_folder
from cubestack.host.terminal import busy, say, show, tell

if TYPE_CHECKING:
    from cubestack.emulator.rtl.capture.board import ComparedCapture
    from cubestack.emulator.rtl.capture.compare import Difference
    from cubestack.emulator.rtl.capture.timing import Interval, Wave

NAME = "compare"

HELP = "compare a logic analyser's capture with the emulated FPGA"

DESCRIPTION = """Compare what a logic analyser captured at the pins of a real board with the
emulated FPGA: the captured inputs are replayed, and the captured outputs must
follow. FILE is VCD, or CSV as sigrok-cli -O csv writes it. Channels are called
as the pins (docs/how-to/logic-analyser.md).

Exit status 0 if all agree, 1 if an output differs.

examples:
  cubestack hdl compare store.vcd --device DEVICE
  cubestack hdl compare store.csv --device DEVICE --map D0=PIXCLK --map 'D7=-'
  cubestack hdl compare store.vcd --device DEVICE --hold BANK=0 --out out/compare"""

VCD_FILE = "compare.vcd"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="capture: VCD or CSV")
    names = [device.name for device in devices() if device.has_fpga]
    parser.add_argument("--device", required=True, choices=names, help="the real board's")
    for name, metavar, meaning in (
        ("--map", "CHANNEL=PIN", "pin of a channel, '-' for none; * matches any letters"),
        ("--hold", "PIN=LEVEL", "level of an input that was not captured, hexadecimal"),
    ):
        parser.add_argument(
            name, action="append", default=[], type=_pair, metavar=metavar, help=meaning
        )
    add_value(
        parser,
        "skew",
        number(
            None,
            "time for which levels may differ (default 2 samples, at least 20 ns)",
            0,
            1e9,
            metavar="NS",
        ),
    )
    add_flag(parser, "--from-power-up", "the capture begins when the FPGA is powered up")
    add_value(
        parser, "last", whole(10, "changes shown before the first difference", 1, metavar="N")
    )
    add_output(
        parser, "--out", f"write both as {VCD_FILE}, for cubestack hdl wave", "DIR", inside=VCD_FILE
    )
    add_flag(parser, "--json", "print one JSON object")
    add_board_arguments(parser)


def run(args: argparse.Namespace) -> int:
    from cubestack.emulator.rtl.capture.board import compare_capture
    from cubestack.emulator.rtl.capture.read import read_capture
    from cubestack.emulator.rtl.capture.write_vcd import write_vcd
    from cubestack.emulator.rtl.factory import make_engine

    device = registered(args.device)
    options = chosen_options(args, device)
    try:
        held = {pin: int(level, 16) for pin, level in args.hold}
    except ValueError:
        raise ValueError("--hold needs PIN=LEVEL with a hexadecimal level: --hold BANK=0") from None
    with busy(f"reading {args.file}"):
        capture = read_capture(args.file)
    wiring = fpga_wiring(device, options)
    with busy("replaying"):
        compared = compare_capture(
            capture,
            wiring,
            lambda: make_engine(wiring),
            mapping=dict(args.map),
            held=held,
            skew_ps=None if args.skew is None else round(args.skew * 1000),
            powered_up=args.from_power_up,
        )
    if args.out is not None:
        with Outputs() as outputs:
            write_vcd(compared, outputs.create(output_folder(args.out) / VCD_FILE))
    if args.json:
        print(json.dumps(_as_json(compared), indent=1))
    else:
        _show(compared, args.last)
        if args.out is not None:
            say(f"cubestack hdl wave {args.out / VCD_FILE} shows both")
    return 1 if compared.comparison.differences else 0


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not equals or not name or not value:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=VALUE")
    return name, value


def _show(compared: "ComparedCapture", last: int) -> None:
    for line in compared.notes:
        say(line)
    counts = compared.comparison.counts
    table = Table("pin", "compared bits", "differences", title="Outputs")
    for pin, bits in compared.comparison.bits.items():
        table.add_row(pin, str(bits.bit_count()), str(counts[pin]))
    show(table)
    if compared.timing:
        show(_timing_table(compared))
    for kind, count in compared.emulated.violations.items():
        tell(f"emulated SRAM: {kind} {count} times")
    differences = compared.comparison.differences
    if not differences:
        tell(f"equal within {compared.skew_ps / 1000:g} ns")
        return
    show(_before(compared, differences[0], last))
    tell(f"first difference: {_words(differences[0])}")
    tell(f"{len(differences)} differences longer than {compared.skew_ps / 1000:g} ns")


def _words(one: "Difference") -> str:
    return (
        f"{one.pin} at {_ns(one.time_ps)} ns: captured {one.captured:X}, emulated {one.emulated:X}"
    )


def _timing_table(compared: "ComparedCapture") -> Table:
    table = Table(
        "time", "count", "min ns", "mean ns", "max ns", "emulated min", "limit", title="Timing"
    )
    resolution = compared.capture.sample_ps or 0.0
    for name, (found, own) in compared.timing.items():
        limit = next(
            (one.least_ps for one in (found, own) if one and one.least_ps is not None), None
        )
        cells = ["0", "", "", ""]
        broken = ""
        if found is not None:
            times = found.found_ps
            cells = [
                str(len(times)),
                *(_ns(value) for value in (times.min(), times.mean(), times.max())),
            ]
            if limit is not None and times.min() + resolution < limit:
                broken = " broken"
        emulated = "" if own is None else _ns(own.found_ps.min())
        table.add_row(name, *cells, emulated, "" if limit is None else f">= {_ns(limit)}{broken}")
    return table


def _before(compared: "ComparedCapture", first: "Difference", count: int) -> Table:
    """The last changes of all compared pins and inputs up to the first difference."""
    captured, emulated = compared.waves
    rows = sorted(
        change
        for source, waves in (("captured", captured), ("emulated", emulated))
        for pin, wave in waves.items()
        if source == "captured" or pin in compared.outputs
        for change in _changes(source, pin, wave, first.time_ps + compared.skew_ps, count)
    )
    table = Table("ns", "pin", "level", "source", title="Changes before the first difference")
    for time_ps, pin, level, source in rows[-count:]:
        table.add_row(_ns(time_ps), pin, f"{level:X}", source)
    return table


def _changes(
    source: str, pin: str, wave: "Wave", until_ps: int, count: int
) -> Iterator[tuple[int, str, int, str]]:
    end = int(wave.times.searchsorted(until_ps, side="right"))
    before: int | None = None
    begin = max(0, end - 50 * count)
    found = []
    for time_ps, level in zip(
        wave.times[begin:end].tolist(), wave.levels[begin:end].tolist(), strict=True
    ):
        if level != before:
            found.append((time_ps, pin, level, source))
        before = level
    yield from found[-count:]


def _as_json(compared: "ComparedCapture") -> dict[str, Any]:
    comparison = compared.comparison
    return {
        "equal": not comparison.differences,
        "skew_ns": compared.skew_ps / 1000,
        "notes": compared.notes,
        "pins": {
            pin: {"compared_bits": bits.bit_count(), "differences": comparison.counts[pin]}
            for pin, bits in comparison.bits.items()
        },
        "differences": [
            {
                "time_ns": one.time_ps / 1000,
                "end_ns": one.end_ps / 1000,
                "pin": one.pin,
                "captured": one.captured,
                "emulated": one.emulated,
            }
            for one in islice(comparison.differences, 1000)
        ],
        "timing_ns": {
            name: {"captured": _statistics(found), "emulated": _statistics(own)}
            for name, (found, own) in compared.timing.items()
        },
        "violations": dict(compared.emulated.violations),
    }


def _statistics(interval: "Interval | None") -> Mapping[str, Any] | None:
    if interval is None:
        return None
    times = interval.found_ps / 1000
    limit = None if interval.least_ps is None else interval.least_ps / 1000
    found = {"min": float(times.min()), "mean": float(times.mean()), "max": float(times.max())}
    return {"count": len(times), **found, "limit": limit}


def _ns(time_ps: float) -> str:
    return f"{time_ps / 1000:.10g}" if time_ps == round(time_ps) else f"{time_ps / 1000:.3f}"
