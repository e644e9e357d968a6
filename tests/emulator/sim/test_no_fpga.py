from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.sim.no_fpga import NoFpga


def test_it_keeps_time_and_has_no_pins() -> None:
    nothing = NoFpga()
    assert nothing.run(5) == nothing.now_ps == 5
    assert nothing.run(9, ("ACK", 1)) == 9
    for use in (
        lambda: nothing.set_pin("ENABLE", 1),
        lambda: nothing.get_pin("ACK"),
        lambda: nothing.strobe_read(np.zeros(1, np.uint8), Fraction(1), 10),
    ):
        with pytest.raises(ValueError, match="this board has no FPGA"):
            use()
