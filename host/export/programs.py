"""Formats for other programs, generated from the interface tables."""

from collections.abc import Callable

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.efm32gg.table import Processor
from cubestack.host.export.c_header import c_header
from cubestack.host.export.cosmos import cosmos
from cubestack.host.export.processor import processor_header
from cubestack.host.export.python_module import python_module
from cubestack.host.export.svd import svd
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
