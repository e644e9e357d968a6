import argparse
import errno
import sys
from contextlib import ExitStack

import pytest

from cubestack.emulator.bus.i2c import I2cMessage
from cubestack.host.cli import run
from cubestack.host.devices.registry import device

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/dev/i2c-N is of Linux")


@pytest.mark.parametrize("names", [("aramis",), ("cubestar", "aramis")])
def test_all_requested_devices_share_one_bus(names: tuple[str, ...]) -> None:
    parser = argparse.ArgumentParser()
    run.add_arguments(parser)
    asked = [word for name in names for word in ("--device", name)]
    results = {}
    with ExitStack() as stack:
        bus = run._emulated(parser.parse_args(["--quiet", *asked, "--", "true"]), stack)
        assert bus.adapter is not None
        for name in ("cubestar", "aramis"):
            told: list[int] = []
            address = device(name).interface.i2c_address
            bus.adapter.submit([I2cMessage(address, read=1)], told.append)
            while not told:
                bus.kernel.step()
            results[name] = told[0]
    assert results == {name: 0 if name in names else -errno.ENXIO for name in results}
