from typing import Any

import pytest

from cubestack.firmware_model.aramis.settings import BODY_PAGE, CONFIG_PAGE, StoredSettings
from cubestack.firmware_model.mcu.memory import FlashStore

TURN = {"Q0": 0.0, "Q1": 0.0, "Q2": 1.0, "Q3": 0.0}


def test_saved_settings_come_back_and_others_do_not() -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetGain", {"Gain": 4.0})
    settings.save()
    settings.put("SetExposure", {"Rows": 17})
    again = StoredSettings(flash)
    assert again.get("SetGain", "Gain") == 4.0
    assert again.get("SetExposure", "Rows") != 17
    again.erase()
    assert again.get("SetGain", "Gain") == 15.0
    assert StoredSettings(flash).get("SetGain", "Gain") == 15.0


def test_the_body_rotation_is_kept_at_once_and_survives_erasing_the_rest() -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetBodyRotation", TURN)
    settings.erase()
    assert StoredSettings(flash).all("SetBodyRotation") == TURN


@pytest.mark.parametrize("page", [CONFIG_PAGE, BODY_PAGE])
@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b"", lambda b: bytes([b[0] ^ 1]) + b[1:]]
)
def test_damaged_pages_are_noticed_and_left_out(page: str, damage: Any) -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetGain", {"Gain": 4.0})
    settings.save()
    settings.put("SetBodyRotation", TURN)
    flash.write(page, damage(flash.read(page)))
    again = StoredSettings(flash)
    assert again.damaged
    for key, command in {CONFIG_PAGE: "SetGain", BODY_PAGE: "SetBodyRotation"}.items():
        assert (again.all(command) == settings.all(command)) == (key != page)
