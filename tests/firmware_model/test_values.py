"""The limits of every declared value: one set of tests for all of them."""

import math
from collections.abc import Iterator
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.hazards import Hazard
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.values import (
    FLAG,
    NUMBER,
    WHOLE,
    Declaration,
    DeclaredValues,
    ListDeclaration,
)
from cubestack.host.devices.registry import devices
from cubestack.host.options import Options

ROOT = Path(__file__).parents[2]
PACKAGES = ("firmware_model", "emulator", "host")

SKY, SUN = {"quaternion": (0.0, 0.0, 0.0, 1.0)}, {"boresight": (0.0, 0.0, 1.0)}
#: What classes without a default for every value are made with here.
NEEDED: dict[str, dict[str, Any]] = {
    "Atmosphere": {"latitude_deg": 0.0, "sidereal_deg": 0.0},
    "Mounting": SUN,
    "Optics": {one.name: getattr(LENS, one.name) for one in fields(LENS)},
    "CampaignPlan": {"device": "cubestar", "frames": 1},
    "PictureScene": {"file": ROOT / "none.png"},
    "Pose": SKY,
    "Reflection": {"camera": 0, "alpha_deg": 0, "beta_deg": 0, "radius_px": 1, "level": 1},
    "SkyCondition": {"optics": LENS},
    "SkyScene": SKY,
}


def owners(kind: type[DeclaredValues] = DeclaredValues) -> Iterator[type[Any]]:
    for one in kind.__subclasses__():
        yield from owners(one)
        is_base = (issubclass(one, Hazard) and not hasattr(one, "name")) or one.__name__[0] == "_"
        if one.__module__.startswith("cubestack.") and one._declared and not is_base:
            yield one


for path in sorted(one for part in PACKAGES for one in (ROOT / part).rglob("*.py")):
    if "firmware_model.values import" in path.read_text(encoding="utf-8"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        import_module(f"cubestack.{name.removesuffix('.__init__')}")
OWNERS = sorted(set(owners()), key=lambda one: (one.__module__, one.__name__))


def beyond(one: Declaration) -> Iterator[float]:
    """The nearest values that are not allowed."""
    for limit, outward in ((one.low, -math.inf), (one.high, math.inf)):
        if math.isfinite(limit):
            whole = one.kind is WHOLE
            yield (
                int(limit + math.copysign(1, outward)) if whole else math.nextafter(limit, outward)
            )
    if one.exclusive:
        yield one.low


def of_other_kinds(one: Declaration) -> list[Any]:
    """Values of other types; None is one unless it is the default."""
    if one.kind.name not in ("number", "whole", "flag", "text", "choice", "moment"):
        return []
    others: list[Any] = [[], {}, b"1"] + ([] if one.default is None else [None])
    if one.kind in (NUMBER, WHOLE):
        others += ["1", True, math.nan, math.inf, -math.inf]
    if one.kind is WHOLE:
        others += [1.5]
    return others + ([2, "true"] if one.kind is FLAG else [])


def scalar(one: Any) -> Any:
    while isinstance(one, ListDeclaration):
        one = one.part
    return one


def filled(one: Declaration, value: Any) -> Any:
    """``value``, or a list of it where the declaration wants one."""
    if not isinstance(one, ListDeclaration):
        return value
    return [filled(one.part, value)] * (2 if one.count is None else one.count)


@pytest.mark.parametrize("owner", OWNERS, ids=lambda one: one.__name__)
def test_values_beyond_their_limits_are_refused_by_name(owner: type[Any]) -> None:
    for name, one in owner.declared().items():
        assert one.meaning
        inner = scalar(one)
        for limit in (inner.low, inner.high):
            if math.isfinite(limit) and not (inner.exclusive and limit == inner.low):
                one.check(filled(one, int(limit) if inner.kind is WHOLE else limit))
        for wrong in beyond(inner):
            with pytest.raises(owner.error) as error:
                owner(**NEEDED.get(owner.__name__, {}) | {name: filled(one, wrong)})
            assert str(error.value) == str(
                owner.refusal(name, f"must be {inner.limits}, not {wrong}")
            )


@pytest.mark.parametrize("owner", OWNERS, ids=lambda one: one.__name__)
def test_values_of_another_type_are_refused_by_name(owner: type[Any]) -> None:
    for name, one in owner.declared().items():
        for wrong in of_other_kinds(scalar(one)):
            if issubclass(owner, Options) and (isinstance(wrong, str) or wrong == one.default):
                continue  # options take texts, and do not check what equals the default
            with pytest.raises(owner.error, match=f"{name}.* must be "):
                owner(**NEEDED.get(owner.__name__, {}) | {name: filled(one, wrong)})


FIELDS = [
    pytest.param(field, id=f"{one.name}-{message.name}-{field.name}")
    for one in devices()
    for message in one.interface.telecommands
    for field in message.fields
    if field.choices is None and None not in field.ends and field.high_by is None
]


@pytest.mark.parametrize("field", FIELDS)
def test_message_fields_allow_what_is_within_their_limits(field: Field) -> None:
    for limit, outward in ((field.low, -1), (field.high, 1)):
        raw = field.encode(limit, saturate=False)
        assert field.allows(field.decode(raw), {})
        step = 2e-7 * max(1.0, abs(limit)) if field.type == "f32" else 1 / field.scale
        beyond = limit + outward * step
        low, high = field.raw_range
        if field.type == "f32" or low <= beyond * field.scale <= high:
            value = field.decode(field.encode(beyond, saturate=False))
            assert not field.allows(value, {}) or value == field.also
