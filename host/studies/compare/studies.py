"""The comparisons by name."""

from cubestack.host.studies.compare.attitude.study import STUDY as ATTITUDE
from cubestack.host.studies.compare.identification.study import STUDY as IDENTIFICATION

STUDIES = {one.name: one for one in (IDENTIFICATION, ATTITUDE)}
