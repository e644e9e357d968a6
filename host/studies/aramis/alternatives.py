"""Triangles by area and moment, and QUEST's quartic, of AraMiS, for `cubestack compare`."""

from functools import partial

from cubestack.firmware_model.aramis.matching.identification import largest_eigenvalue
from cubestack.host.studies.aramis.areas import PLANAR, SPHERICAL, Areas
from cubestack.host.studies.compare.attitude.methods import Method as AttitudeMethod
from cubestack.host.studies.compare.attitude.methods import quest_with
from cubestack.host.studies.compare.identification.methods import Method

IDENTIFICATION = (
    Method("spherical triangle", "A 5.4", partial(Areas, shape=SPHERICAL)),
    Method("planar triangle", "A 5.5 to 5.8", partial(Areas, shape=PLANAR)),
)
ATTITUDE = (AttitudeMethod("QUEST, quartic", "A 6.2", quest_with(largest_eigenvalue)),)
