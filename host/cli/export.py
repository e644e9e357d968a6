"""Write a device's interface for other programs, from the tables that firmware and
host share. `cubestack registers` lists them for people.

  c            C99 header: IDs, offsets, scales, accessors
  python       module with a dataclass per message; no dependencies
  xtce         XTCE 1.2, for mission control systems
  cosmos       OpenC3 COSMOS commands and telemetry (cmd_tlm file)
  wireshark    Lua dissector for the protocol on a TCP port
  processor-c  C header of the processor's registers and pin connections
  svd          CMSIS-SVD of the processor, for debuggers

examples:
  cubestack export {first} --format c --out {first}.h
  cubestack export {first} --format xtce --out {first}.xml
"""

import argparse
from collections.abc import Callable

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.efm32gg.table import Processor
from cubestack.host.cli.arguments import add_path
from cubestack.host.devices.registry import device, emulated_names
from cubestack.host.export.c_header import c_header
from cubestack.host.export.cosmos import cosmos
from cubestack.host.export.processor import processor_header, svd
from cubestack.host.export.python_module import python_module
from cubestack.host.export.wireshark import wireshark
from cubestack.host.export.xtce import xtce

#: Exporter of an interface by format.
OF_INTERFACE: dict[str, Callable[[Interface], str]] = {
    "c": c_header,
    "python": python_module,
    "xtce": xtce,
    "cosmos": cosmos,
    "wireshark": wireshark,
}

#: Exporter of a processor's registers by format.
OF_PROCESSOR: dict[str, Callable[[Processor], str]] = {"processor-c": processor_header, "svd": svd}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "device", choices=emulated_names(), help="device whose interface is written"
    )
    parser.add_argument("--format", choices=(*OF_INTERFACE, *OF_PROCESSOR), required=True)
    add_path(parser, "--out", "default: standard output")


def run(args: argparse.Namespace) -> int:
    found = device(args.device)
    if args.format in OF_INTERFACE:
        if not found.interface.messages:
            raise ValueError(f"{found.name} has no messages; choose {' or '.join(OF_PROCESSOR)}")
        text = OF_INTERFACE[args.format](found.interface)
    elif found.processor is None:
        raise ValueError(f"the processor of {found.name} runs no firmware of your own")
    else:
        text = OF_PROCESSOR[args.format](found.processor())
    if args.out is None:
        print(text, end="")
    elif args.out.is_dir():
        raise ValueError(f"--out {args.out} is a folder; name a file in it")
    else:
        args.out.write_text(text, encoding="utf-8")
    return 0
