"""Telecommands that change a firmware's switches, and telemetry that shows them.

Made of the switches' declaration. A switch has the number of its place there, and a value that of
its name among the values of all switches, so that one name is one number everywhere.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import IntEnum
from types import new_class
from typing import NamedTuple, TypeVar

from cubestack.firmware_model.interface.codec.field import Choices, Value, enum8, u8
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switches import MIXED, PROFILES, Switches

SwitchesT = TypeVar("SwitchesT", bound=Switches)

SET_PROFILE, SET_SWITCH, SHOWN = "SetProfile", "SetSwitch", "Profile"

_PROFILES = (*PROFILES, MIXED)


class SwitchMessages(NamedTuple):
    """What an interface has for its switches."""

    telecommands: tuple[Message, ...]
    telemetry: Message


def switch_messages(
    switches: type[Switches], telecommand: int, telemetry: int, kept: str
) -> SwitchMessages:
    """Messages for ``switches``, extensions all.

    ``telecommand`` is the first of two IDs, ``telemetry`` the third's; ``kept`` says what becomes
    of a change at a reset. Switches of the board are shown, and no telecommand knows them.
    """
    declared, numbers = switches.declared(), _value_numbers(switches)
    values = {
        name: _choices(
            _field_name(name),
            f"Values of switch {name}: {one.meaning}.",
            {key: numbers[key] for key in (_value_name(name, value) for value in one.choices)},
        )
        for name, one in declared.items()
    }
    places = {name: at for at, name in enumerate(declared) if not declared[name].hardware}
    of_switch = {at: values[name] for name, at in places.items()}
    every = {one.name: int(one) for choices in of_switch.values() for one in choices}
    profile = enum8(
        "Profile",
        "of all switches together",
        choices=_choices("Profile", "How switches are set.", _numbered(_PROFILES)),
    )
    effect = f"of the firmware from the next picture on; {kept}"
    messages = (
        Message(telecommand, SET_PROFILE, f"set switches {effect}").of(
            profile.within(None, len(PROFILES) - 1)
        ),
        Message(telecommand + 1, SET_SWITCH, f"set a switch {effect}").of(
            u8(
                "Switch",
                "which one",
                choices=_choices("Switch", "Switches of the firmware.", places),
                reset=min(of_switch),
            ),
            u8(
                "Value",
                "one of that switch's values",
                choices=_choices("SwitchValue", "Values of all switches of the firmware.", every),
                choices_by=("Switch", of_switch),
                reset=min(of_switch[min(of_switch)]),
            ),
        ),
        Message(telemetry, SHOWN, "which algorithms the device runs").of(
            profile,
            *(
                enum8(_field_name(name), one.meaning, choices=values[name])
                for name, one in declared.items()
            ),
        ),
    )
    *telecommands, shown = (replace(message, extension=True) for message in messages)
    return SwitchMessages(tuple(telecommands), shown)


def shown_values(switches: Switches) -> dict[str, int]:
    """What telemetry shows of them."""
    numbers = _value_numbers(type(switches))
    values = {"Profile": _PROFILES.index(switches.profile)}
    for name in switches.declared():
        values[_field_name(name)] = numbers[_value_name(name, getattr(switches, name))]
    return values


def switches_shown(switches: type[SwitchesT], values: Mapping[str, Value]) -> SwitchesT:
    """The ``switches`` of which telemetry has these ``values``; ValueError for a wrong one."""
    numbers = {name: int(values[_field_name(name)]) for name in switches.declared()}
    return switches(**{name: _value(switches, name, at) for name, at in numbers.items()})


def after(switches: SwitchesT, telecommand: str, values: Mapping[str, Value]) -> SwitchesT:
    """The switches once one of the telecommands, whose ``values`` it allows, was executed."""
    declared = switches.declared()
    if telecommand == SET_PROFILE:
        profile = _PROFILES[int(values["Profile"])]
        firmware = {name: one for name, one in declared.items() if not one.hardware}
        return replace(switches, **{name: getattr(one, profile) for name, one in firmware.items()})
    name = list(declared)[int(values["Switch"])]
    return replace(switches, **{name: _value(type(switches), name, int(values["Value"]))})


def switch_parameters(switch: str, value: str) -> dict[str, str]:
    """Parameters of SetSwitch, by the names that the declaration has."""
    return {"Switch": switch.upper(), "Value": _value_name(switch, value)}


def _value(switches: type[Switches], name: str, number: int) -> str:
    numbers, choices = _value_numbers(switches), switches.declared()[name].choices
    for value in choices:
        if numbers[_value_name(name, value)] == number:
            return value
    raise ValueError(f"switch {name} has no value with number {number}")


def _value_numbers(switches: type[Switches]) -> dict[str, int]:
    return _numbered(
        _value_name(name, value)
        for name, one in switches.declared().items()
        for value in one.choices
    )


def _numbered(names: Iterable[str]) -> dict[str, int]:
    return {name: at for at, name in enumerate(dict.fromkeys(names))}


def _choices(name: str, meaning: str, numbers: Mapping[str, int]) -> Choices:
    members = {"__doc__": meaning, **{key.upper(): number for key, number in numbers.items()}}
    made = new_class(name, (IntEnum,), exec_body=lambda body: body.update(members))
    assert issubclass(made, IntEnum)
    return made


def _value_name(switch: str, value: str) -> str:
    """``value`` as a name in any language: a number has that of its switch in front."""
    name = re.sub(r"\W", "_", value).upper()
    return f"{switch.upper()}_{name}" if name[0].isdigit() else name


def _field_name(switch: str) -> str:
    return switch.title().replace("_", "")
