"""Supply currents and load switches of AraMiS' star tracker."""

from cubestack.emulator.sim.power import Part, PowerTable

#: MT9M001 data sheet: 363 mW working, 294 uW in standby, at 3.3 V. Other parts are assumed: the
#: thesis has only a figure with their sum (2.16).
ARAMIS_POWER = PowerTable(
    volts=3.3,
    parts={
        "camera": Part("camera", {"standby": 0.1, "working": 110.0}),
        "processor": Part(None, {"sleep": 15.0, "run": 110.0}),
        "sdram": Part(None, {"on": 60.0}),
        "flash": Part(None, {"on": 5.0}),
    },
    channels={"camera": None},
)
