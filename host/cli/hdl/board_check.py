"""`cubestack hdl board check`."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from cubestack.firmware_model.interface.devboard.address import PREFIX, parse_address
from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_output, add_value
from cubestack.host.cli.device_options import add_board_arguments, chosen_options
from cubestack.host.cli.hdl.design import fpga_wiring
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices
from cubestack.host.output import Outputs, output_folder
from cubestack.host.terminal import busy, progress, say, show, tell

if TYPE_CHECKING:
    from cubestack.emulator.rtl.devboard.check import Found, Wave
    from cubestack.emulator.rtl.devboard.link import Counters

NAME = "check"

HELP = "compare a board with the compiled engine"

DESCRIPTION = """Compare a development board with the compiled engine: random levels of the
pins, rows of random pixels, read-outs, and a whole frame for each way to store.
Prints the first difference, with the pins before it.

Exit status 1 if there is a difference, or the board fails.

examples:
  cubestack hdl board check /dev/ttyUSB1 --device DEVICE
  cubestack hdl board check /dev/ttyUSB1@1000000 --device DEVICE --steps 1000 --seed 7"""

VCD_FILE = "board-check.vcd"

_SHOWN = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("port", metavar="PORT[@BAUD]", help="the board's serial port")
    names = [device.name for device in devices() if device.has_fpga]
    parser.add_argument("--device", required=True, choices=names, help="whose design it runs")
    add_value(parser, "seed", whole(0, "seed of the random steps", 0))
    add_value(parser, "steps", whole(200, "number of random steps", 0, metavar="N"))
    add_value(parser, "frames", whole(1, "whole frames for each way to store", 0, metavar="N"))
    add_output(
        parser, "--out", f"write the pins around a difference as {VCD_FILE}", "DIR", inside=VCD_FILE
    )
    add_flag(parser, "--json", "print one JSON object")
    add_board_arguments(parser)


def run(args: argparse.Namespace) -> int:
    from cubestack.emulator.rtl.devboard.board import open_board
    from cubestack.emulator.rtl.devboard.check import BoardCheck
    from cubestack.emulator.rtl.devboard.engine import DevboardEngine
    from cubestack.emulator.rtl.factory import make_engine

    device = registered(args.device)
    options = chosen_options(args, device)
    address = parse_address(PREFIX + args.port.removeprefix(PREFIX))
    wiring = fpga_wiring(device, options)
    opened: list[DevboardEngine] = []

    def open_one() -> DevboardEngine:
        opened.append(open_board(wiring, address))
        return opened[-1]

    with busy("planning the steps"):
        check = BoardCheck(
            wiring,
            open_one,
            lambda: make_engine(wiring, "compiled"),
            seed=args.seed,
            steps=args.steps,
            frames=args.frames,
        )
    *_, found = [None, *progress(check.run(), len(check), "steps", quiet=args.json)]
    counters = [engine.link.counters for engine in opened]
    if found is not None and args.out is not None:
        _write_vcd(found, args.out)
    if args.json:
        print(json.dumps(_as_json(found, len(check), counters), indent=1))
    else:
        _show(found, len(check), counters)
        if found is not None and args.out is not None:
            say(f"cubestack hdl wave {args.out / VCD_FILE} shows board (PIN) and engine (EMU_PIN)")
    return 0 if found is None else 1


def _show(found: "Found | None", steps: int, counters: "list[Counters]") -> None:
    sent, received, frames, repeated = _sums(counters)
    say(f"{frames} frames, {repeated} repeated; {sent} bytes sent, {received} received")
    if found is None:
        tell(f"no difference in {steps} steps")
        return
    table = Table("ns", "pin", "board", "compiled", title="Changes before the first difference")
    for row in _changes(found)[-3 * _SHOWN :]:
        table.add_row(*row)
    show(table)
    tell(f"first difference in {found.step}")
    for text in found.texts[:_SHOWN]:
        tell(f"  {text}")
    if not found.repeated:
        tell("it did not come again when the steps were repeated: the board is not stable")


def _changes(found: "Found") -> list[tuple[str, str, str, str]]:
    rows: list[tuple[str, str, str, str]] = []
    before: Wave | None = None
    for wave in found.waves:
        for pin, level in wave.compiled.items():
            own = wave.board[pin]
            if before is None or (before.board[pin], before.compiled[pin]) != (own, level):
                mark = "" if own == level else " differs"
                if before is not None or mark:
                    rows.append((f"{wave.time_ps / 1000:.3f}", pin, f"{own:X}", f"{level:X}{mark}"))
        before = wave
    return rows


def _sums(counters: "list[Counters]") -> tuple[int, int, int, int]:
    return (
        sum(one.sent for one in counters),
        sum(one.received for one in counters),
        sum(one.frames for one in counters),
        sum(one.repeated for one in counters),
    )


def _write_vcd(found: "Found", folder: Path) -> None:
    from vcd import VCDWriter

    with (
        Outputs() as outputs,
        VCDWriter(
            outputs.create(output_folder(folder) / VCD_FILE),
            timescale="1 ps",
            version="cubestack",
            date="",
        ) as writer,
    ):
        pins = found.waves[0].compiled if found.waves else {}
        variables = {
            prefix + pin: writer.register_var("board", prefix + pin, "wire", size=32)
            for prefix in ("", "EMU_")
            for pin in pins
        }
        start = found.waves[0].time_ps if found.waves else 0
        for wave in found.waves:
            for pin in pins:
                writer.change(variables[pin], wave.time_ps - start, wave.board[pin])
                writer.change(variables[f"EMU_{pin}"], wave.time_ps - start, wave.compiled[pin])


def _as_json(found: "Found | None", steps: int, counters: "list[Counters]") -> dict[str, Any]:
    sent, received, frames, repeated = _sums(counters)
    line = {"frames": frames, "repeated": repeated, "sent": sent, "received": received}
    if found is None:
        return {"equal": True, "steps": steps, "line": line}
    return {
        "equal": False,
        "step": found.step,
        "differences": list(found.texts),
        "repeated": found.repeated,
        "waves": [wave._asdict() for wave in found.waves],
        "line": line,
    }
