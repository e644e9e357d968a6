"""SunSlit's board: array, FPGA, line buffer, microcontroller, the satellite's UART and I2C."""

from dataclasses import replace
from functools import cache
from typing import Any

from cubestack.sensor import (
    CORTEX_M3,
    CameraPins,
    CameraSite,
    Level,
    MemoryPins,
    NodeBoard,
    Part,
    PowerTable,
    RtlEngine,
    Sites,
    Wiring,
)
from linear_sun_sensor.array import LinearArray
from linear_sun_sensor.pins import ACK, ADC, DATA, DCLK, ENABLE, EXPOSE, OSC, RNW, SI, VALID
from linear_sun_sensor.program import SunSlitProgram
from linear_sun_sensor.scene import SlitScene
from linear_sun_sensor.top import SunSlitTop


@cache
def wiring() -> Wiring:
    """What is soldered to the FPGA; kept, as finding its compiled form takes time."""

    def storing(level: Level) -> tuple[str, ...]:
        return ("array",) if level(ENABLE) and not level(RNW) and not level(ACK) else ()

    return Wiring(
        SunSlitTop(),
        cameras=(CameraPins("array", OSC, ADC, VALID),),
        memories=(MemoryPins("SRAM"),),
        data_clock=DCLK,
        data=DATA,
        acknowledges=(ACK,),
        storing=storing,
        settling_clocks=8,
    )


class SunSlitBoard(NodeBoard[SunSlitProgram, SlitScene]):
    """One emulated SunSlit.

    Attributes:
        array: the photodiodes, which look at the scene.
    """

    program_type = SunSlitProgram
    costs = CORTEX_M3
    scene_type = SlitScene
    supplies = PowerTable(
        volts=3.3,
        parts={
            "array": Part("array", {"on": 3.5}),  # TSL1401CL: 2.8 mA, and its converter
            "fpga": Part(None, {"on": 2.0}),
            "processor": Part(None, {"sleep": 2.4, "run": 9.6}),
        },
        channels={"array": None},
    )
    engine: RtlEngine

    def __init__(self, scene: SlitScene, **common: Any) -> None:
        """Power up; ``common`` is what every ``NodeBoard`` takes."""
        super().__init__(scene, **common)
        self.array = LinearArray(lambda: self.scene, lambda: self.engine.get_pin(SI))
        self.engine.attach(self.array)
        self.power.on_switch = lambda _channel, on: self._switch(on, self.kernel.now)

    def _wiring(self) -> Wiring:
        return wiring()

    def probes(self) -> dict[str, int | str]:
        """What a trace shows: the latest outcome beside what all boards show."""
        return super().probes() | {"outcome": self.program.latest.outcome.name}

    def sites(self) -> Sites:
        """Where faults can hit."""
        return replace(
            super().sites(),
            controls=(ENABLE, RNW, EXPOSE),
            cameras={"array": CameraSite(self.array, self._switch, "array")},
        )

    def _switch(self, on: bool, now_ps: int) -> None:
        """Switch the array's supply; the FPGA may have run ahead."""
        self.engine.run(max(now_ps, self.engine.now_ps))
        self.array.powered = on
        self.engine.stream_changed("array")
