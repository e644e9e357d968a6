import pytest

from cubestack.host.cli.hdl.design import fpga_wiring
from cubestack.host.devices.registry import device, devices

WITH_FPGA = [one.name for one in devices() if one.has_fpga]


@pytest.mark.parametrize("name", WITH_FPGA)
def test_profile_and_switches_are_those_of_the_device(name: str) -> None:
    chosen = device(name)
    for options in ({"profile": "extended"}, {"profile": "published", "set": ""}):
        assert fpga_wiring(chosen, options).component is not None
    with pytest.raises(ValueError, match="'letters' is not SWITCH=VALUE"):
        fpga_wiring(chosen, {"set": "letters"})
