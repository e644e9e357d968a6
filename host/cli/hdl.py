"""FPGA designs: area, Verilog for other tools, formal proofs, waveforms of failed
tests.

examples:
  cubestack hdl area
  cubestack hdl area --ice40 --json
  cubestack hdl verilog TOP --out top.v
  cubestack hdl verilog TOP | yosys -f verilog -p 'synth_ice40' -
  cubestack hdl prove sun-scan
  cubestack hdl wave whole_frame
"""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from cubestack.firmware_model.values import whole
from cubestack.hdl.flow.area_report import area_json, area_table, areas
from cubestack.hdl.flow.top import TopTable, designs_with_area, tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.hdl.proofs.prover import Proof, verdict_json, verdict_text, verdicts
from cubestack.host.cli.arguments import Parser, add_flag, add_path, add_value
from cubestack.host.cli.waveform import find, show
from cubestack.host.devices.registry import merged_tables
from cubestack.host.terminal import progress, tell

Entry = TypeVar("Entry")

AREA = """How many of the AGLN030's 768 tiles each design takes: a tile is one
3-input table or one flip-flop. An estimate: Yosys simplifies, a search covers
the result with tables, and nothing is placed. Blocks are counted alone; inside
of a top they share logic.

examples:
  cubestack hdl area
  cubestack hdl area "Sun search" "nadir scan"
  cubestack hdl area --ice40    a public yardstick beside it: iCE40 cells
  cubestack hdl area --ice40 --fmax --json    what each area.json in hdl/ tracks"""

VERILOG = """One Verilog file that needs no other: a wrapper with the real pins,
bidirectional ones too, around the design itself, with a list of the pins and a
stub of constraints as comments. Icarus Verilog, Yosys and Verilator take it
without a warning.

examples:
  cubestack hdl verilog TOP --out top.v     a wrong name of TOP lists all
  cubestack hdl verilog TOP | yosys -f verilog -p 'synth_ice40' -"""

PROVE = """Prove properties of the designs by induction: for any run time, any image and
any order of clock edges. Each proof then runs on a design with a planted bug,
which it must find. Needs the extra hdl; all proofs take one to two minutes.

Exit status 1 if a property is not proved or a planted bug is not found.

examples:
  cubestack hdl prove
  cubestack hdl prove sun-scan pair-drivers
  cubestack hdl prove --json"""

WAVE = """Show the waveform of a failed gateware test, which `make test-hdl` and
`make test` keep: in gtkwave or surfer if installed and a screen is available,
else as text with the last changes of the pins.

examples:
  cubestack hdl wave whole_frame    part of a test's name; a wrong name lists all
  cubestack hdl wave whole_frame --text --internal --last 50"""


def _all_tops() -> TopTable:
    return merged_tables(lambda device: device.tops())


def _all_proofs() -> Mapping[str, Proof]:
    return merged_tables(lambda device: device.proofs())


def add_arguments(
    parser: argparse.ArgumentParser,
    tops: Callable[[], TopTable] = _all_tops,
    proofs: Callable[[], Mapping[str, Proof]] = _all_proofs,
) -> None:
    """Declare the subcommands and their options, for these tops and proofs."""
    parser.set_defaults(tops=tops, proofs=proofs)
    actions = parser.add_subparsers(
        dest="action", required=True, metavar="ACTION", parser_class=Parser
    )
    area = actions.add_parser(
        "area", help="list the tiles that every design uses", description=AREA
    )
    area.add_argument("names", metavar="NAME", nargs="*", help="designs; default: all")
    add_flag(area, "--json", "as JSON")
    add_flag(area, "--ice40", "count iCE40 cells too; needs the extra hdl")
    add_flag(area, "--fmax", "place on an iCE40 HX8K; needs the extra place")
    area.set_defaults(act=_area)
    verilog = actions.add_parser(
        "verilog", help="write a top as one Verilog file", description=VERILOG
    )
    verilog.add_argument("top", metavar="TOP", help="a top; a wrong name lists them")
    add_path(verilog, "--out", "default: standard output")
    verilog.set_defaults(act=_verilog)
    prove = actions.add_parser("prove", help="prove properties of the designs", description=PROVE)
    prove.add_argument("names", metavar="NAME", nargs="*", help="proofs; default: all")
    add_flag(prove, "--json", "print JSON when all are done")
    prove.set_defaults(act=_prove)
    wave = actions.add_parser("wave", help="show the waveform of a failed test", description=WAVE)
    wave.add_argument("test", metavar="TEST", help="part of its name, or a VCD file")
    wave.add_argument(
        "--folder", type=Path, default=Path("out/hdl/waves"), help="default: %(default)s"
    )
    add_flag(wave, "--text", "print text even if a viewer is installed")
    add_value(wave, "last", whole(20, "number of changes in the text", 1, metavar="N"))
    add_flag(wave, "--internal", "include internal signals in the text")
    wave.set_defaults(act=_wave)


def run(args: argparse.Namespace) -> int:
    return int(args.act(args))


def _chosen(table: Mapping[str, Entry], names: list[str], kind: str) -> dict[str, Entry]:
    """These of a table, all without a name; ValueError when one is not in it."""
    for name in names:
        if name not in table:
            raise ValueError(f"{name!r} is no {kind}; there are {', '.join(table)}")
    return {name: table[name] for name in names or table}


def _area(args: argparse.Namespace) -> int:
    table = _chosen(designs_with_area(args.tops()), args.names, "design of one FPGA")
    counting = areas(table, args.ice40, args.fmax)
    rows = list(progress(counting, len(table), "designs", quiet=args.json))
    print(area_json(rows) if args.json else "\n".join(area_table(rows)))
    return 0


def _verilog(args: argparse.Namespace) -> int:
    (top,) = _chosen(tops_in(args.tops()), [args.top], "top").values()
    text = verilog_file(args.top, top)
    if args.out is None:
        print(text, end="")
    else:
        args.out.write_text(text, encoding="utf-8")
    return 0


def _prove(args: argparse.Namespace) -> int:
    chosen = _chosen(args.proofs(), args.names, "proof")
    done = []
    for verdict in progress(verdicts(chosen), len(chosen), "proofs", quiet=args.json):
        done.append(verdict)
        if not args.json:
            tell(verdict_text(verdict))
    if args.json:
        print(verdict_json(done))
    return 0 if all(verdict.good for verdict in done) else 1


def _wave(args: argparse.Namespace) -> int:
    for line in show(find(args.folder, args.test), args.last, args.internal, args.text):
        print(line)
    return 0
