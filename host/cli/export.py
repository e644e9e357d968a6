"""Write a device's interface for other programs, from the tables that firmware and
host share. `cubestack registers` lists them for people.

  c              C99 header: IDs, offsets, scales, accessors
  python         module with a dataclass per message; no dependencies
  xtce           XTCE 1.2, for mission control systems
  cosmos         OpenC3 COSMOS commands and telemetry (cmd_tlm file)
  cosmos-plugin  folder of an OpenC3 COSMOS plug-in
  wireshark      Lua dissector for the protocol on a TCP port
  processor-c    C header of the processor's registers and pin connections
  svd            CMSIS-SVD of the processor, for debuggers

examples:
  cubestack export {first} --format c --out {first}.h
  cubestack export {first} --format xtce --out {first}.xml
  cubestack export {first} --format cosmos-plugin --out openc3-cosmos-{first}
"""

import argparse
from collections.abc import Callable

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.efm32gg.table import Processor
from cubestack.host.cli.arguments import add_output
from cubestack.host.devices.registry import device, emulated_names
from cubestack.host.export.c_header import c_header
from cubestack.host.export.cosmos.packets import cosmos
from cubestack.host.export.cosmos.plugin import cosmos_plugin
from cubestack.host.export.processor import processor_header, svd
from cubestack.host.export.python_module import python_module
from cubestack.host.export.wireshark import wireshark
from cubestack.host.export.xtce import xtce
from cubestack.host.output import write_new_folder, write_output

#: Exporter of an interface by format.
OF_INTERFACE: dict[str, Callable[[Interface], str]] = {
    "c": c_header,
    "python": python_module,
    "xtce": xtce,
    "cosmos": cosmos,
    "wireshark": wireshark,
}

#: Exporter of an interface by format, to the files of a folder.
TO_FOLDER: dict[str, Callable[[Interface], dict[str, str]]] = {"cosmos-plugin": cosmos_plugin}

#: Exporter of a processor's registers by format.
OF_PROCESSOR: dict[str, Callable[[Processor], str]] = {"processor-c": processor_header, "svd": svd}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "device", choices=emulated_names(), help="device whose interface is written"
    )
    parser.add_argument(
        "--format", choices=(*OF_INTERFACE, *TO_FOLDER, *OF_PROCESSOR), required=True
    )
    add_output(parser, "--out", "default: standard output; a new folder for cosmos-plugin")


def run(args: argparse.Namespace) -> int:
    found = device(args.device)
    if args.format not in OF_PROCESSOR and not found.interface.messages:
        raise ValueError(f"{found.name} has no messages; choose {' or '.join(OF_PROCESSOR)}")
    if args.format in TO_FOLDER:
        if args.out is None:
            raise ValueError(f"{args.format} is a folder; name one with --out")
        write_new_folder(args.out, TO_FOLDER[args.format](found.interface))
        return 0
    if args.format in OF_INTERFACE:
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
        write_output(args.out, text)
    return 0
