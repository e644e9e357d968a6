"""Declared values: reading, texts, and the limits of every one that there is."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.values import (
    FLAG,
    NUMBER,
    REQUIRED,
    WHOLE,
    Declaration,
    DeclaredValues,
    ListDeclaration,
    TableDeclaration,
    choice,
    described,
    duration,
    flag,
    number,
    positive,
    read_table,
    text,
    vector,
    whole,
)
from cubestack.host.devices.registry import devices
from cubestack.host.options import Options
from cubestack.host.studies.powerfail.scenario import Question, Step
from tests.together import together

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
    "Pointing": {"quaternion": (0.0, 0.0, 0.0, 1.0)},
    "Pose": SKY,
    "Question": {"name": "what", "send": "?"},
    "Reflection": {"camera": 0, "alpha_deg": 0, "beta_deg": 0, "radius_px": 1, "level": 1},
    "Scenario": {
        "device": "efm32gg",
        "question": (Question(name="a", send="?"),),
        "step": (Step(telecommand="SaveConfig"),),
    },
    "SkyCondition": {"optics": LENS},
    "SkyScene": SKY,
}


@dataclass(frozen=True)
class Some(DeclaredValues):
    angle_deg: float = number(1.0, "an angle", -3, 4, formerly="angle")
    rate_km_s: float = positive(2.0, "a rate")
    count: int = whole(3, "how many", high=9)
    on: bool = flag(False, "on")
    way: int = choice(1, "where to", {"up": 1, "down": 2})
    at: tuple[float, ...] = vector(2, (0.0, 1.0), "where")
    label: str | None = text(None, "a name")
    plain: str = "anything"


KEYS = Some.declared()


@pytest.mark.parametrize(
    ("name", "given", "value"),
    [
        ("angle_deg", 4, 4.0),
        ("angle_deg", 5, "-3 to 4 deg, not 5"),
        ("angle_deg", 10**400, "a number, not 1000"),
        ("angle_deg", math.nan, "a number, not nan"),
        ("rate_km_s", 0, "above 0 km/s, not 0"),
        ("count", np.int64(9), 9),
        ("count", 10, "at most 9, not 10"),
        ("count", 2.0, "a whole number, not 2.0"),
        ("on", 1, "true or false, not 1"),
        ("way", "down", 2),
        ("way", 2, "one of up, down, not 2"),
        ("at", np.array([1, 2]), (1.0, 2.0)),
        ("at", [1], "a list of 2 numbers, not [1]"),
        ("at", [1, "2"], "a number, not '2'"),
        ("label", 5, "text, not 5"),
    ],
)
def test_values_accept_file_and_python_values(name: str, given: Any, value: Any) -> None:
    if not isinstance(value, str):
        assert KEYS[name].read(given) == value
        return
    with pytest.raises(ValueError, match=f"^must be {re.escape(value)}"):
        KEYS[name].read(given)


@pytest.mark.parametrize(
    ("name", "given", "value"),
    [
        ("angle_deg", "-1e0", -1.0),
        ("angle_deg", "x", "a number, not 'x'"),
        ("angle_deg", "9", "-3 to 4 deg, not 9.0"),
        ("count", "0x8", 8),
        ("count", "1.0", "a whole number, not '1.0'"),
        ("on", "TRUE", True),
        ("way", "left", "one of up, down, not 'left'"),
        ("at", "1,2", (1.0, 2.0)),
        ("at", "1", "a list of 2 numbers, not '1'"),
    ],
)
def test_values_parse_command_line_texts(name: str, given: str, value: Any) -> None:
    if not isinstance(value, str):
        assert KEYS[name].parse(given) == KEYS[name].take(given) == value
        return
    with pytest.raises(ValueError, match=f"^must be {re.escape(value)}"):
        KEYS[name].parse(given)


def test_read_table_rejects_missing_wrong_and_unknown_keys() -> None:
    keys = {**KEYS, "needed": whole(REQUIRED, "is needed")}
    assert read_table({"count": 1, "needed": 2}, keys) == {"count": 1, "needed": 2}
    for table, message in (
        ({}, "needs the key needed"),
        ({"needed": "x"}, "needed must be a whole number, not 'x'"),
        ({"other": 1}, "unknown key 'other'; allowed are angle_deg, rate_km_s"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            read_table(table, keys)
    with pytest.warns(FutureWarning, match=r"key angle is deprecated .* write angle_deg"):
        assert read_table({"angle": 2}, KEYS) == {"angle_deg": 2.0}


def test_value_limits_can_depend_on_other_values() -> None:
    some = Some(count=5)
    some.check_within("count", low=5)
    with pytest.raises(ValueError, match=r"^count must be 6 to 9, not 5$"):
        some.check_within("count", low=6)


def test_describes_values_for_forms() -> None:
    assert described(KEYS)["angle_deg"] == {
        **{"type": "number", "unit": "deg", "default": 1.0},
        **{"low": -3, "high": 4, "meaning": "an angle"},
    }
    assert KEYS["way"].described()["choices"] == ["up", "down"]
    assert KEYS["way"].described()["default"] == "up"
    assert KEYS["at"].described()["of"] == {"type": "number"}
    assert "plain" not in KEYS


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


@pytest.mark.parametrize(
    ("given", "seconds"),
    [("5s", 5.0), ("5", 5.0), ("200ms", 0.2), ("1.5 s", 1.5), ("30us", 3e-5), ("1e-3", 1e-3)],
)
def test_durations_have_a_unit_or_are_seconds(given: str, seconds: float) -> None:
    assert duration(None, "").parse(given) == pytest.approx(seconds, rel=1e-12)


@pytest.mark.parametrize("given", ["5x", "s", "", "5 sm", "5ss", "m", "1h", "ms5"])
def test_other_durations_are_refused(given: str) -> None:
    with pytest.raises(ValueError, match=r"^must be a time such as 5s or 200ms, not '"):
        duration(None, "").parse(given)


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
    if isinstance(one, TableDeclaration):
        return []  # its keys are declarations of their own
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
    if not isinstance(one, ListDeclaration):
        return value
    return [filled(one.part, value)] * (2 if one.count is None else one.count)


@together("owner", OWNERS, ids=lambda one: one.__name__)
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


@together("owner", OWNERS, ids=lambda one: one.__name__)
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


@together("field", FIELDS)
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
