from dataclasses import fields, replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import camera_state, star_light
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.scene_file import hazard_tables
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards import SKY_HAZARDS
from cubestack.emulator.scene.hazards.contract import SkyHazard
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER
from tests.tiers import quick

KINDS = list(SKY_HAZARDS.values())


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_hazard_describes_itself(kind: type[SkyHazard]) -> None:
    assert 4 < len(kind.meaning) < 70
    assert 5 <= len(kind.strength.values) <= 7
    assert kind.strength.usual in kind.strength.values
    kind()  # every key has a default


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
@pytest.mark.parametrize("optics", quick([LENS, double_gauss()], 1), ids=["cubestar", "aramis"])
def test_every_strength_renders(kind: type[SkyHazard], optics: Optics) -> None:
    now = camera_state(ORION, optics, SHUTTER)
    for seed, strength in enumerate(kind.strength.values):
        hazard = kind.sample(strength, now, np.random.default_rng(seed))
        light = star_light(replace(ORION, hazards=(hazard,)), optics, SHUTTER)
        assert np.isfinite(light).all()
        assert light.min() >= 0


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_worst_disturbs_more_than_mildest(kind: type[SkyHazard]) -> None:
    now = camera_state(ORION, LENS, SHUTTER)
    clean = star_light(ORION, LENS, SHUTTER)
    mild, bad = (
        sum(
            float(
                np.abs(star_light(replace(ORION, hazards=(hazard,)), LENS, SHUTTER) - clean).sum()
            )
            for hazard in (kind.sample(s, now, np.random.default_rng(k)) for k in range(3))
        )
        for s in (kind.strength.values[0], kind.strength.values[-1])
    )
    assert bad > mild


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_is_drawn_from_the_generator_alone(kind: type[SkyHazard]) -> None:
    first, same, other = (
        kind.sample(kind.strength.usual, NOW, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first == same
    assert first != other


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_sampled_hazard_round_trips_through_a_file(kind: type[SkyHazard]) -> None:
    hazard = kind.sample(kind.strength.usual, NOW, np.random.default_rng(4))
    assert set(kind.declared()) == {entry.name for entry in fields(kind)}
    values = {entry.name: getattr(hazard, entry.name) for entry in fields(kind)}
    table = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in values.items()
        if value is not None
    }
    assert hazard_tables(SKY_HAZARDS).read({kind.name: table}) == (hazard,)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_lights_move_at_the_declared_rate(kind: type[SkyHazard]) -> None:
    """By that the renderer knows how often to look at them."""
    now = camera_state(ORION, LENS, SHUTTER)
    hazard = kind.sample(kind.strength.usual, now, np.random.default_rng(3))
    here, soon = (hazard.lights(replace(now, time_s=now.time_s + dt)) for dt in (0.0, 1.0))
    if here is None or soon is None:
        assert hazard.speed_deg_s == 0
        return
    chords = np.linalg.norm(soon.vectors - here.vectors, axis=1)
    fastest_deg_s = np.degrees(2 * np.arcsin(chords / 2)).max()
    assert hazard.speed_deg_s == pytest.approx(fastest_deg_s, abs=1e-3)


def test_rejects_scene_hazard_of_wrong_type() -> None:
    with pytest.raises(SceneError, match="hazards must be hazards of light, not 'moon'"):
        SkyScene([0, 0, 0, 1], hazards=("moon",))  # type: ignore[arg-type]
