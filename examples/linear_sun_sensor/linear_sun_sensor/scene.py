"""What SunSlit sees: the Sun at an angle. Scene files have ``kind = "sun-slit"`` and these keys."""

from dataclasses import dataclass, replace

import numpy as np

from cubestack.sensor import (
    SUN_RADIUS_DEG,
    Body,
    CameraField,
    DeclaredScene,
    Pointing,
    SceneError,
    SkyMap,
    flag,
    matrix_from_quaternion,
    number,
    whole,
)


@dataclass(frozen=True)
class SlitScene(DeclaredScene):
    """The Sun in the plane of boresight and array; positive angles are towards the last pixel."""

    kind = "sun-slit"

    sun_deg: float = number(12.0, "from the boresight, in the plane of the array", -90, 90)
    brightness: float = number(1.0, "of the Sun at 1 au", 0, 100)
    noise: bool = flag(True, "whether pixels have any")
    seed: int = whole(0, "of the noise", 0, 2**32)

    def pointed(self, pointing: Pointing, at_s: float) -> "SlitScene":
        """The Sun at the attitude of ``pointing``, which stays until the next one."""
        del at_s
        if pointing.sun is None:
            raise SceneError("point needs sun, its direction in inertial axes")
        x, _, z = matrix_from_quaternion(pointing.quaternion) @ np.asarray(pointing.sun)
        return replace(self, sun_deg=float(np.clip(np.degrees(np.arctan2(x, z)), -90, 90)))

    def sky_map(self, now_ps: int) -> SkyMap:
        """Where Sun and field are, on a map of the sky."""
        angles = np.radians([self.sun_deg, *range(-45, 46, 5)])
        sun, *field = np.transpose([np.sin(angles), 0 * angles, np.cos(angles)])
        array = CameraField("array", np.eye(3), np.array(field))
        turn = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # the boresight in the map's middle
        bodies = (Body("Sun", sun, SUN_RADIUS_DEG),)
        return SkyMap("the sensor's axes", (array,), bodies=bodies, turn=turn)
