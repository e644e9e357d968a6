"""Telecommands that change a firmware's switches, and telemetry that shows them.

They are derived from the switches' declaration. A switch's number is its position there; a value's
number is its position among the value names of all switches, so that a name always has one number.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import IntEnum
from types import new_class
from typing import TypeVar

from cubestack.firmware_model.interface.codec.field import Choices, Value, enum8, u8
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switches import MIXED, PROFILES, Switches

SwitchesT = TypeVar("SwitchesT", bound=Switches)

SET_PROFILE, SET_SWITCH, SHOWN = "SetProfile", "SetSwitch", "Profile"

_PROFILES = (*PROFILES, MIXED)


def switch_messages(
    switches: type[Switches], telecommand: int, telemetry: int, kept: str
) -> tuple[Message, ...]:
    """SetProfile, SetSwitch and telemetry Profile of ``switches``, all of them extensions.

    ``telecommand`` is the first of two IDs, ``telemetry`` the third ID; ``kept`` describes the
    effect of a reset on a change. Telemetry shows switches of the board too; no telecommand sets
    them.
    """
    declared, numbers = switches.declared(), _numbers(switches)
    values = [
        _choices(_field_name(name), f"Values of switch {name}: {one.meaning}.", numbers[name])
        for name, one in declared.items()
    ]
    shown = [
        enum8(_field_name(name), one.meaning, choices=choices)
        for (name, one), choices in zip(declared.items(), values, strict=True)
    ]
    places = {name: at for at, name in enumerate(declared) if not declared[name].hardware}
    every = {key: number for name in places for key, number in numbers[name].items()}
    which = _choices("Switch", "Switches of the firmware.", places)
    any_value = _choices("SwitchValue", "Values of all switches of the firmware.", every)
    of_switch = {at: values[at] for at in places.values()}
    first = min(of_switch)
    profiles = _choices("Profile", "Profiles of the switches.", _numbered(_PROFILES))
    profile = enum8("Profile", "of all switches together", choices=profiles)
    settable = profile.within(None, len(PROFILES) - 1)
    switch = u8("Switch", "switch to set", choices=which, reset=first)
    value = u8("Value", "one of that switch's values", choices=any_value, reset=min(values[first]))
    effect = f"of the firmware from the next image on; {kept}"
    return (
        Message(telecommand, SET_PROFILE, f"set a profile {effect}", extension=True).of(settable),
        Message(telecommand + 1, SET_SWITCH, f"set a switch {effect}", extension=True).of(
            switch, replace(value, choices_by=("Switch", of_switch))
        ),
        Message(telemetry, SHOWN, "algorithms in use", extension=True).of(profile, *shown),
    )


def shown_values(switches: Switches) -> dict[str, int]:
    values = {"Profile": _PROFILES.index(switches.profile)}
    for name, numbers in _numbers(type(switches)).items():
        values[_field_name(name)] = numbers[_value_name(name, getattr(switches, name))]
    return values


def read_switches(switches: type[SwitchesT], values: Mapping[str, Value]) -> SwitchesT:
    """The ``switches`` with these telemetry ``values``; raises ValueError for a wrong one."""
    names = switches.declared()
    return switches(**{n: _value(switches, n, int(values[_field_name(n)])) for n in names})


def apply_command(switches: SwitchesT, telecommand: str, values: Mapping[str, Value]) -> SwitchesT:
    """The switches after one of the telecommands with valid ``values``."""
    declared = switches.declared()
    if telecommand == SET_PROFILE:
        profile = _PROFILES[int(values["Profile"])]
        firmware = {name: one for name, one in declared.items() if not one.hardware}
        return replace(switches, **{name: getattr(one, profile) for name, one in firmware.items()})
    name = list(declared)[int(values["Switch"])]
    return replace(switches, **{name: _value(type(switches), name, int(values["Value"]))})


def switch_parameters(switch: str, value: str) -> dict[str, str]:
    """Parameters of SetSwitch, from the names in the declaration."""
    return {"Switch": switch.upper(), "Value": _value_name(switch, value)}


def _numbers(switches: type[Switches]) -> dict[str, dict[str, int]]:
    """Number of each value's name, by switch."""
    names = {
        name: [_value_name(name, value) for value in one.choices]
        for name, one in switches.declared().items()
    }
    numbers = _numbered(name for ours in names.values() for name in ours)
    return {switch: {name: numbers[name] for name in ours} for switch, ours in names.items()}


def _value(switches: type[Switches], name: str, number: int) -> str:
    """The value as declared; an unknown one is returned as its number, which no switch accepts."""
    choices: tuple[str, ...] = switches.declared()[name].choices
    values = zip(_numbers(switches)[name].values(), choices, strict=True)
    return dict(values).get(number, str(number))


def _numbered(names: Iterable[str]) -> dict[str, int]:
    return {name: at for at, name in enumerate(dict.fromkeys(names))}


def _choices(name: str, meaning: str, numbers: Mapping[str, int]) -> Choices:
    members = {"__doc__": meaning, **{key.upper(): number for key, number in numbers.items()}}
    choices = new_class(name, (IntEnum,), exec_body=lambda body: body.update(members))
    assert issubclass(choices, IntEnum)
    return choices


def _value_name(switch: str, value: str) -> str:
    """``value`` as an identifier; the switch's name precedes one that starts with a digit."""
    name = re.sub(r"\W", "_", value).upper()
    return f"{switch.upper()}_{name}" if name[0].isdigit() else name


def _field_name(switch: str) -> str:
    return switch.title().replace("_", "")
