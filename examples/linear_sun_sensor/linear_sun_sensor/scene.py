"""What SunSlit sees: the Sun at an angle. Scene files have ``kind = "sun-slit"`` and these keys."""

from dataclasses import dataclass
from pathlib import Path

from cubestack.emulator.scene import file
from cubestack.emulator.scene.file import SceneError


@dataclass(frozen=True)
class SlitScene:
    """The Sun in the plane of boresight and array.

    Attributes:
        sun_deg: from the boresight, -90 to 90, positive towards the last pixel.
        brightness: of the Sun at 1 au, 0 or more.
        noise: whether pixels have any.
        seed: of it.
    """

    sun_deg: float = 12.0
    brightness: float = 1.0
    noise: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what can not be; SceneError names it."""
        if not -90 <= self.sun_deg <= 90:
            raise SceneError(f"sun_deg must be -90 to 90, not {self.sun_deg:g}")
        for name in ("brightness", "seed"):
            if getattr(self, name) < 0:
                raise SceneError(f"{name} must be 0 or more, not {getattr(self, name):g}")


_KEYS = {"sun_deg": file.number, "brightness": file.number, "noise": file.flag, "seed": file.whole}


def load_scene(path: Path) -> SlitScene:
    """The scene that a TOML file describes; SceneError names the key that is wrong."""
    kinds = {"sun-slit": lambda table: SlitScene(**file.read_table(table, _KEYS))}
    return file.read_scene_file(path, kinds, '"sun-slit"')
