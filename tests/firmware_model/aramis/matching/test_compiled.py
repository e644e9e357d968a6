"""The compiled search for triangles equals the Python form, in results and charges."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.ranges import triangles_within
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED, Configuration
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.host.studies.aramis.sky import FIELD, Light, database, picture
from tests.firmware_model.compiled import assert_equal_forms

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")

SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=40)
@given(SEEDS, st.lists(st.integers(0, 300), max_size=6), st.booleans(), st.booleans())
def test_triangles_within_bounds(seed: int, sizes: list[int], near: bool, unaligned: bool) -> None:
    rng, onboard = np.random.default_rng(seed), database()
    if unaligned:  # as in an image
        moved = bytearray(b"-" + onboard.moment_triangles.tobytes())
        onboard = replace(onboard, moment_triangles=np.frombuffer(moved, np.uint32, offset=1))
    lengths = np.array(sizes, np.int64)
    starts = rng.integers(0, len(onboard) - 300, len(sizes))
    known = onboard.moment_triangles  # bounds are triangles of a range
    ends = [np.sort(known[rng.integers(start, start + 300, 2)]) for start in starts]
    bounds = np.array(ends, np.int64).reshape(-1, 2).T
    faces = rng.random(len(onboard.sphere.centres)) < 0.5 if near else None
    areas = bounds[0], bounds[1]
    assert_equal_forms(
        lambda _: triangles_within(onboard, (starts, lengths), areas, faces), BLACKFIN_BF533
    )


@pytest.mark.parametrize("configuration", [PUBLISHED, VERIFIED], ids=["published", "extended"])
@settings(max_examples=10)
@given(seed=SEEDS, false=st.integers(0, 8), near=st.booleans())
def test_identification(configuration: Configuration, seed: int, false: int, near: bool) -> None:
    rng = np.random.default_rng(seed)
    made = picture(rng, FIELD, Light(false_stars=false))
    hint = made.hint(2.0, rng) if near else None
    profile = configuration.profile
    assert_equal_forms(
        lambda meter: identify(made.stars, FIELD, profile, database(), meter, hint), BLACKFIN_BF533
    )
