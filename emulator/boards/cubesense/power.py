"""Supply currents and load switches of CubeSense's board."""

from cubestack.emulator.sim.power import Part, PowerTable

_SRAM = {"standby": 4.6, "active": 7.6}  # fitted, as all below
_CAMERA = {"on": 25.15}

#: CubeSense thesis, table 7.1: the whole board's current at 5 V in eight states. Each figure is
#: fitted to it, as the mean over both halves: 4.4 and 4.8 mA per memory, 27.8 and 22.5 mA per
#: camera, 7.4 and 7.2 mA per half that is imaging. The split of the last is assumed. Reading has a
#: ninetieth of imaging's clock, so its current is neglected. Currents are measured at 5 V, ahead of
#: linear regulators, so they equal the parts' own currents.
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
