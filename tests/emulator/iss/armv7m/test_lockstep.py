"""Random programs, equal on the simulator and on unicorn's Cortex-M3.

A short share runs with the suite; all of it: CUBESTACK_LOCKSTEP=5000000 pytest -s -k lockstep.

What is kept out because unicorn is not a Cortex-M3 there (sections of the ARMv7-M ARM):

- writes to SP of addresses that are not of words: bits 1:0 are 0 (B1.4.1), QEMU keeps them;
- BASEPRI: it has the part's priority bits (B1.4.3), QEMU's all eight;
- YIELD is a NOP here (A7.7.263), and ends unicorn's run; WFI and WFE would wait for ever in both;
- ISB in an IT block: unicorn runs the rest of the block unconditionally (A7.3 says otherwise);
- STREX whose address is not that of LDREX, or with other stores between: the part's monitor tags
  no address (A3.4.1 leaves it open), QEMU's compares address and content;
- what the manual calls UNPREDICTABLE, and accesses that fault: test_core.py and test_faults.py.
"""

import os
from collections import Counter
from random import Random

import pytest

from cubestack.emulator.native.compiler import find_compiler

pytest.importorskip("unicorn", reason="unicorn is not installed")

from .encodings import ENCODINGS
from .oracle import Pair, UnequalError
from .programs import RAM_BYTES, Generator

INSTRUCTIONS = int(os.environ.get("CUBESTACK_LOCKSTEP", "60000"))
SLICE = 24

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")


def test_random_programs() -> None:
    random = Random(1)
    pair = Pair(random.randbytes(0x4000), random.randbytes(RAM_BYTES))
    generator = Generator(2)
    done, number = 0, 0
    classes: Counter[str] = Counter()
    while done < INSTRUCTIONS:
        slice_ = generator.slice(SLICE)
        number += 1
        try:
            done += pair.run(slice_)
        except UnequalError as error:
            code = " ".join(f"{half:04x}" for half in slice_.code)
            raise AssertionError(
                f"slice {number} at {slice_.start:#x}: {error}\n{code}\n{slice_.classes}"
            ) from error
        classes.update(slice_.classes)
    missing = {encoding.name for encoding in ENCODINGS} - classes.keys()
    assert not missing
    print(f"\n{done} instructions in {number} slices, {len(classes)} classes, "
          f"the rarest {min(classes.values())} times")  # fmt: skip
