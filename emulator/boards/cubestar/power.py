"""Supply currents and load switches of CubeStar's boards."""

from cubestack.emulator.sim.power import Part, PowerTable

#: CubeStar thesis, sections 5.2.3 and 6.3, table 6.2: the whole stack's current in four modes. The
#: split into parts is fitted to them, one current per mode; two parts are known: the two LEDs
#: (396.2 mW less 350 mW), and the processor with 200 uA/MHz running and 50 uA/MHz asleep
#: (appendix E). Trip currents are assumed: a third above the highest regular current for the boards
#: with imager and FPGA, ten times the highest for the memory, which draws little.
CUBESTAR_POWER = PowerTable(
    volts=3.3,
    parts={
        "leds": Part(None, {"on": 14.0}),  # fitted: 46.2 mW
        "processor": Part(None, {"sleep": 2.4, "run": 9.6}),  # chosen: data sheet, 48 MHz
        "memory": Part("memory", {"standby": 2.0, "transfer": 3.0}),  # chosen share
        "imager": Part("imager", {"disabled": 42.8, "enabled": 92.8}),  # fitted: mode 2 less 1
        # Fitted: mode 3 less mode 2 and mode 4 less mode 1, less running processor and memory.
        "fpga": Part("imager", {"standby": 10.0, "storing": 58.9, "reading": 12.41}),
    },
    channels={"memory": 30.0, "imager": 200.0},
)
