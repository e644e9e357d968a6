"""What the parts of CubeSense's board draw, by state, and behind which load switch they are."""

from cubestack.emulator.sim.power import Part, PowerTable

_SRAM = {"standby": 4.6, "active": 7.6}  # fitted, as all below
_CAMERA = {"on": 25.15}

#: CubeSense thesis, table 7.1: the whole board's current at 5 V in eight states. Each figure is
#: fitted to it, as the mean of what the two halves add: 4.4 and 4.8 mA a memory, 27.8 and 22.5 mA a
#: camera, 7.4 and 7.2 mA a side that is imaging. How the last divides is assumed. Reading
#: has a ninetieth of imaging's clock, so it counts as none. Currents are measured at 5 V, ahead of
#: linear regulators, so each is also the part's own.
CUBESENSE_POWER = PowerTable(
    volts=5.0,
    parts={
        "processor": Part(None, {"reset": 0.0, "on": 4.0}),
        "fpgas": Part(None, {"on": 8.4}),
        "sun_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "nadir_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "sram1": Part("SRAM1", _SRAM),
        "sram2": Part("SRAM2", _SRAM),
        "sun_camera": Part("sun_camera", _CAMERA),
        "nadir_camera": Part("nadir_camera", _CAMERA),
    },
    channels={"SRAM1": None, "SRAM2": None, "sun_camera": None, "nadir_camera": None},
)
