"""Upsets in flash and RAM: corrected, or reported with a reason, never a wrong attitude."""

import pytest

from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.firmware_model.interface.aramis import CatalogueState, MeasurementOutcome, Reason

from .desk import ORION, Desk


def test_flipped_bits_are_corrected_on_activation(desk: Desk) -> None:
    flips = desk.board.irradiate("flash", 1e-6)
    assert desk.aramis.activate() is CatalogueState.GOOD
    status = desk.client.telemetry("CatalogueStatus")
    assert flips > 3
    assert 0 < status["Corrected"] <= flips
    assert status["Lost"] == 0
    assert desk.flags() == {"CatalogueCorrected"}
    assert desk.aramis.measure().valid


def test_double_error_is_reported_and_yields_no_attitude(desk: Desk) -> None:
    desk.flip_flash(4321, 7, 50)
    assert desk.aramis.activate() is CatalogueState.DAMAGED
    found = desk.aramis.measure()
    expected = False, MeasurementOutcome.NONE, Reason.CATALOGUE_DAMAGED
    assert (found.valid, found.outcome, found.reason) == expected
    assert desk.client.telemetry("CatalogueStatus")["Lost"] == 1
    assert "CatalogueDamaged" in desk.flags()


def test_upsets_in_ram_are_found_before_the_next_match(active: Desk) -> None:
    active.board.irradiate("sdram", 1e-6)
    assert active.aramis.measure().valid
    assert active.error_deg()[0] < 0.01
    assert active.flags() == {"RamError"}
    assert active.client.telemetry("CatalogueStatus")["RamErrors"] == 1


def test_the_catalogue_is_reloaded_periodically_and_can_be_refreshed(active: Desk) -> None:
    active.client.command("SetReloadPeriod", Period=2)
    active.flip_flash(100, 3)
    active.client.pause(7)
    status = active.client.telemetry("CatalogueStatus")
    assert [status[name] for name in ("Loads", "Corrected", "CorrectedTotal")] == [4, 1, 3]
    active.client.command("SetReloadPeriod", Period=0)
    active.client.command("RefreshCatalogue")
    active.client.wait_processed(100)
    active.command("ReloadCatalogue")
    assert active.client.telemetry("CatalogueStatus")["Corrected"] == 0
    assert active.aramis.measure().valid


@pytest.mark.parametrize("seed", range(6))
def test_heavy_radiation_never_yields_a_wrong_attitude(seed: int) -> None:
    """At a rate that breaks words, a measurement is right or says why there is none."""
    desk = Desk(seed=seed)
    desk.board.irradiate("flash", [3e-6, 1e-5, 3e-5, 1e-4, 1e-3, 1e-2][seed])
    state = desk.aramis.activate()
    found = desk.aramis.measure()
    if state is CatalogueState.GOOD:
        assert found.valid
        assert attitude_error_deg(found.quaternion, ORION)[0] < 0.01
    else:
        assert not found.valid
        assert found.reason in (Reason.CATALOGUE_DAMAGED, Reason.NO_CATALOGUE)
