"""XML description of the target for GDB: features org.gnu.gdb.arm.m-profile and m-system.

GDB manual, appendices "Target Descriptions" and "Memory Map Format".
"""

from collections.abc import Iterable

from cubestack.emulator.iss.gdb.target import MemoryRegion

CORE = (*(f"r{number}" for number in range(13)), "sp", "lr", "pc")
XPSR_NUMBER = 25
"""GDB's number of the status register; 16 to 24 belonged to the FPA coprocessor."""

SYSTEM = ("msp", "psp", "primask", "basepri", "faultmask", "control")

REGISTERS = dict(enumerate(CORE)) | dict(enumerate(("xpsr", *SYSTEM), start=XPSR_NUMBER))
"""Names by number, in the order of the packet that carries all registers."""

TYPES = {"sp": "data_ptr", "pc": "code_ptr", "msp": "data_ptr", "psp": "data_ptr"}


def _features() -> str:
    def described(names: Iterable[str]) -> str:
        return "".join(
            f'<reg name="{name}" bitsize="32" regnum="{number}" type="{TYPES.get(name, "int")}"/>'
            for number, name in REGISTERS.items()
            if name in names
        )

    return (
        f'<feature name="org.gnu.gdb.arm.m-profile">{described((*CORE, "xpsr"))}</feature>'
        f'<feature name="org.gnu.gdb.arm.m-system">{described(SYSTEM)}</feature>'
    )


TARGET_XML = (
    '<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd">'
    f"<target><architecture>arm</architecture>{_features()}</target>"
)


def memory_map(regions: Iterable[MemoryRegion]) -> str:
    lines = []
    for region in regions:
        head = f'<memory type="{region.kind}" start="{region.start:#x}" length="{region.length:#x}"'
        if region.kind == "flash":
            lines.append(f'{head}><property name="blocksize">{region.block:#x}</property></memory>')
        else:
            lines.append(f"{head}/>")
    return (
        '<?xml version="1.0"?><!DOCTYPE memory-map PUBLIC "+//IDN gnu.org//DTD GDB Memory Map V1.0'
        '//EN" "http://sourceware.org/gdb/gdb-memory-map.dtd">'
        f"<memory-map>{''.join(lines)}</memory-map>"
    )
