"""Random programs have the same results on the simulator and on unicorn's Cortex-M3.

CUBESTACK_LOCKSTEP is the number of instructions: CUBESTACK_LOCKSTEP=5000000 pytest -s -k lockstep.

Left out because unicorn differs from a Cortex-M3 (sections of the ARMv7-M ARM):

- SP with bits 1:0 set: they are 0 (B1.4.1), QEMU keeps them;
- BASEPRI: it has the part's priority bits (B1.4.3), QEMU's all eight;
- YIELD, a NOP (A7.7.263), ends unicorn's run; WFI and WFE would wait forever in both;
- ISB in an IT block: unicorn runs the rest of the block unconditionally, against A7.3;
- STREX to another address than LDREX, or after another store: the part's monitor has no address
  (A3.4.1 allows both), QEMU's compares address and content;
- UNPREDICTABLE instructions, and accesses that fault: test_core.py and test_faults.py.
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


def test_random_programs_have_the_results_of_unicorn() -> None:
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
