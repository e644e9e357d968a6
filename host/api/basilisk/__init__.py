"""Modules for Basilisk, the astrodynamics simulator (https://avslab.github.io/basilisk): emulated
star trackers, Sun and Earth sensors in place of its models. Needs the package ``bsk``.

A module reads the spacecraft's true state and writes the message that Basilisk's own sensor or
estimator would write:

- `StarTracker`: ``STSensorMsg``, as ``starTracker`` does.
- `SunSensor`: ``NavAttMsg`` with ``vehSunPntBdy``, as ``cssWlsEst`` does. A CubeSense measures a
  direction; ``CSSArraySensorMsg`` has the cosines of photodiodes, which it does not have.
- `EarthSensor`: ``BodyHeadingMsg``, the message of a direction without a distance.

The time tag is the middle of the image's exposure, in ns for ``STSensorMsg`` and in s for
``NavAttMsg``. ``BodyHeadingMsg`` has no tag: there it is the time in the header. A missing fix is a
message of zeros, of which no quaternion or direction consists, with the time of the request.

A task period is one measurement: it is started at one call and written at the next one. While the
device is still busy, nothing is written.
"""

from cubestack.host.errors import install_command

try:
    import Basilisk  # noqa: F401
except ImportError:
    raise ImportError(f"cubestack.basilisk needs Basilisk: {install_command('basilisk')}") from None

from cubestack.basilisk.sensors import EarthSensor, StarTracker, SunSensor

__all__ = ["EarthSensor", "StarTracker", "SunSensor"]
