import numpy as np
import pytest

from cubestack.emulator.faults.declaration import FaultError
from cubestack.firmware_model.aramis.catalogue.hamming import CODED_BYTES, DATA_BYTES
from cubestack.firmware_model.aramis.hardware import CATALOGUE_AT, PICTURES_AT
from cubestack.firmware_model.interface.aramis import CatalogueState, LatchUpStep, Reason

from .bench import Tracker

WORD = 4321


def current_ma(tracker: Tracker) -> float:

    return float(tracker.telemetry("SupplyStatus")["Current"])


def switch(tracker: Tracker, step: LatchUpStep) -> None:
    tracker.client.command("LatchUpAction", Step=step)
    tracker.client.wait_processed(1)


@pytest.fixture
def active(tracker: Tracker) -> Tracker:
    assert tracker.device.activate() is CatalogueState.GOOD
    return tracker


@pytest.mark.fault("memory-flip")
@pytest.mark.parametrize(
    ("bits", "state"), [((7,), CatalogueState.GOOD), ((7, 50), CatalogueState.DAMAGED)]
)
def test_one_flipped_flash_bit_is_corrected_and_two_are_reported(
    tracker: Tracker, bits: tuple[int, ...], state: CatalogueState
) -> None:
    flash = tracker.board.catalogue_flash
    for bit in bits:
        address, place = divmod(8 * CODED_BYTES * WORD + bit, 8)
        before = flash[address]
        tracker.inject("memory-flip", target="flash", address=address, bit=place)
        assert flash[address] == before ^ 1 << place
    assert tracker.device.activate() is state
    status = tracker.telemetry("CatalogueStatus")
    if state is CatalogueState.GOOD:
        assert (status["Corrected"], status["Lost"]) == (1, 0)
        assert tracker.flags() == {"CatalogueCorrected"}
        tracker.check()
    else:
        assert status["Lost"] == 1
        found = tracker.measure()
        assert (found.valid, found.reason) == (False, Reason.CATALOGUE_DAMAGED)
        assert "CatalogueDamaged" in tracker.flags()


@pytest.mark.fault("memory-flip")
def test_flipped_catalogue_bit_in_ram_is_found_and_reloaded(active: Tracker) -> None:
    address = CATALOGUE_AT + DATA_BYTES * WORD
    before = active.board.sdram[address]
    active.inject("memory-flip", target="sdram", address=address, bit=3)
    assert active.board.sdram[address] == before ^ 8
    active.check()
    assert active.board.sdram[address] == before
    assert active.flags() == {"RamError"}
    assert active.telemetry("CatalogueStatus")["RamErrors"] == 1


@pytest.mark.fault("memory-flip")
def test_flipped_image_bit_changes_one_bit(active: Tracker) -> None:
    active.check()
    place = PICTURES_AT[active.board.program._camera.latest]
    number = 77
    active.client.command("ImageBlockSet", BlockNumber=number)
    active.client.wait_processed(1)
    expected = bytearray(active.telemetry("ImageBlock")["Block"])
    active.inject("memory-flip", target="sdram", address=place + 128 * number + 5, bit=6)
    expected[5] ^= 0x40
    assert active.telemetry("ImageBlock")["Block"] == expected
    assert active.flags() == set()
    active.check()


@pytest.mark.fault("memory-upsets")
def test_flash_upsets_are_corrected_at_reload(active: Tracker) -> None:
    before = active.board.catalogue_flash.copy()
    active.client.command("SetReloadPeriod", Period=2)
    active.inject("memory-upsets", target="flash", rate=1e-7)
    active.client.pause(9)
    active.faults.clear()
    flipped = int(np.unpackbits(active.board.catalogue_flash ^ before).sum())
    assert flipped == len(active.faults.log) > 5
    status = active.telemetry("CatalogueStatus")
    assert status["CorrectedTotal"] > 0
    assert (status["Loads"] >= 4, status["Lost"]) == (True, 0)
    assert active.flags() == {"CatalogueCorrected"}
    active.check()


@pytest.mark.fault("memory-upsets")
def test_ram_upsets_are_found_before_the_catalogue_is_used(active: Tracker) -> None:
    active.inject("memory-upsets", target="sdram", rate=1e-6)
    active.client.pause(2)
    active.faults.clear()
    assert len(active.faults.log) > 100
    active.check()
    assert active.flags() == {"RamError"}


@pytest.mark.parametrize("lasting", [False, True])
@pytest.mark.fault("latch-up")
def test_latched_up_camera_draws_current_until_the_host_acts(
    active: Tracker, lasting: bool
) -> None:
    usual_ma = current_ma(active)
    active.inject("latch-up", lasting=lasting, extra_ma=300.0)
    assert current_ma(active) == pytest.approx(usual_ma + 300, abs=1)
    active.check()
    assert active.flags() == set()  # whoever watches the current decides
    switch(active, LatchUpStep.OFF)
    assert current_ma(active) == 0
    assert active.measure().reason is Reason.CAMERA_OFF
    switch(active, LatchUpStep.ON)
    assert current_ma(active) == pytest.approx(usual_ma + 300 * lasting, abs=1)
    active.check()


def test_memory_stuck_is_rejected_without_fpga(tracker: Tracker) -> None:
    with pytest.raises(FaultError, match="only a memory of a device with an FPGA"):
        tracker.inject("memory-stuck")
