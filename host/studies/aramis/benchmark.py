"""Cost of emulating AraMiS."""

from dataclasses import replace

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import read_settings
from cubestack.firmware_model.aramis.detection.mask import LevelHistory
from cubestack.firmware_model.aramis.pipeline import VERIFIED, solve
from cubestack.firmware_model.interface.aramis import MeasurementMode
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.devices.device import Device
from cubestack.host.emulation.emulated import power_up
from cubestack.host.studies.bench import LOOP_S, Benchmark, best_ms, simulated_ratio

HIGHEST_GAIN = 15.0


def _figures(device: Device[AramisBoard, Aramis]) -> dict[str, float]:
    database = onboard_database()
    with power_up(device) as emulated:
        emulated.client.activate()
        client = emulated.client.client
        client.command("StartLoop", Period=1000, Mode=MeasurementMode.LOST_IN_SPACE)
        client.pause(2.0)
        ratio = simulated_ratio(emulated, lambda: client.pause(float(LOOP_S)))
        client.command("StopLoop")
        imager = Mt9m001Imager()
        settings = replace(read_settings(RegisterFile(REGISTERS)), gains=(HIGHEST_GAIN,) * 4)
        shutter, scene = emulated.board.ppi.stored, emulated.scene
        assert shutter is not None
        frame_ms = best_ms(lambda: imager.render(scene, CONDITION, shutter, settings))
        picture = imager.render(scene, CONDITION, shutter, settings)
    meter = Meter(BLACKFIN_BF533)
    solve_ms = best_ms(lambda: solve(picture, LevelHistory(), VERIFIED, database, meter))
    return {"aramis_ratio": ratio, "aramis_frame_ms": frame_ms, "aramis_solve_ms": solve_ms}


BENCHMARK = Benchmark(
    {
        "aramis_ratio": "as realtime_ratio, lost in space with verification",
        "aramis_frame_ms": "rendering one image with all its stars and noise",
        "aramis_solve_ms": "one solve, from the picture to the attitude",
    },
    _figures,
)
