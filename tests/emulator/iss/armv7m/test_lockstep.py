"""Random programs, equal on the simulator and on unicorn's Cortex-M3.

A short share runs with the suite; all of it: CUBESTACK_LOCKSTEP=5000000 pytest -s -k lockstep.
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
