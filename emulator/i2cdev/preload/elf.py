"""Whether a program is linked dynamically, so that a library can be loaded into it.

System V ABI, chapter 5: a program with an interpreter has a program header of type PT_INTERP.
"""

import struct
from pathlib import Path

PT_INTERP = 3
CLASS_64 = 2
LITTLE_ENDIAN = 1

_TABLE = struct.Struct("<Q14xHH")  # at 32: e_phoff; at 54: e_phentsize, e_phnum
_TABLE_AT = 32
_TYPE = struct.Struct("<I")


def is_static(program: Path) -> bool:
    """Whether ``program`` is an executable of 64 bits without an interpreter.

    False for scripts, and for whatever can not be read: the kernel will say what it thinks of it.
    """
    try:
        with program.open("rb") as file:
            head = file.read(64)
            if len(head) < 64 or head[:6] != b"\x7fELF" + bytes((CLASS_64, LITTLE_ENDIAN)):
                return False
            start, size, count = _TABLE.unpack_from(head, _TABLE_AT)
            file.seek(start)
            table = file.read(size * count)
    except (OSError, ValueError, OverflowError):
        return False
    if size < _TYPE.size or len(table) < size * count:
        return False
    types = [_TYPE.unpack_from(table, size * index)[0] for index in range(count)]
    return PT_INTERP not in types
