"""AraMiS: faults of the memories and of the camera's supply."""

import numpy as np
import pytest

from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.firmware_model.aramis.catalogue.hamming import CODED_BYTES, DATA_BYTES
from cubestack.firmware_model.aramis.memory import CATALOGUE_AT, PICTURES_AT
from cubestack.firmware_model.interface.aramis import CatalogueState, LatchUpStep, Reason

from .bench import Bench

WORD = 4321
LATCHED_MA = 300.0


def current_ma(bench: Bench) -> float:
    """The camera unit's supply current as the host sees it."""
    return float(bench.telemetry("SupplyStatus")["Current"])


def switch(bench: Bench, step: LatchUpStep) -> None:
    """Switch the camera unit."""
    bench.client.command("LatchUpAction", Step=step)
    bench.client.wait_processed(1)


@pytest.fixture
def active(tracker: Bench) -> Bench:
    assert tracker.device.activate() is CatalogueState.GOOD
    return tracker


def check_right(bench: Bench) -> None:
    """A measurement gives the truth's attitude."""
    found = bench.device.measure()
    assert found.valid
    assert attitude_error_deg(found.quaternion, bench.board.truth(found.frame))[0] < 0.01


def flip_word(bench: Bench, word: int, *bits: int) -> None:
    """Turn over bits of a coded word in flash."""
    for bit in bits:
        address, place = divmod(8 * CODED_BYTES * word + bit, 8)
        before = bench.board.catalogue_flash[address]
        bench.inject("memory-flip", target="flash", address=address, bit=place)
        assert bench.board.catalogue_flash[address] == before ^ 1 << place


@pytest.mark.fault("memory-flip")
def test_one_flipped_bit_of_a_word_in_flash_is_corrected(tracker: Bench) -> None:
    flip_word(tracker, WORD, 7)
    assert tracker.device.activate() is CatalogueState.GOOD
    status = tracker.telemetry("CatalogueStatus")
    assert (status["Corrected"], status["Lost"]) == (1, 0)
    assert tracker.flags() == {"CatalogueCorrected"}
    check_right(tracker)
    tracker.client.command("RefreshCatalogue")  # writes the flash anew
    tracker.client.wait_processed(300)
    tracker.client.command("ReloadCatalogue")
    tracker.client.wait_processed(10)
    assert tracker.telemetry("CatalogueStatus")["Corrected"] == 0


@pytest.mark.fault("memory-flip")
def test_two_flipped_bits_of_a_word_in_flash_are_reported(tracker: Bench) -> None:
    flip_word(tracker, WORD, 7, 50)
    assert tracker.device.activate() is CatalogueState.DAMAGED
    assert tracker.telemetry("CatalogueStatus")["Lost"] == 1
    found = tracker.device.measure()
    assert (found.valid, found.reason) == (False, Reason.CATALOGUE_DAMAGED)
    assert "CatalogueDamaged" in tracker.flags()


@pytest.mark.fault("memory-flip")
def test_a_flipped_bit_of_the_catalogue_in_ram_is_found_and_reloaded(active: Bench) -> None:
    address = CATALOGUE_AT + DATA_BYTES * WORD
    before = active.board.sdram[address]
    active.inject("memory-flip", target="sdram", address=address, bit=3)
    assert active.board.sdram[address] == before ^ 8
    check_right(active)
    assert active.board.sdram[address] == before
    assert active.flags() == {"RamError"}
    assert active.telemetry("CatalogueStatus")["RamErrors"] == 1


@pytest.mark.fault("memory-flip")
def test_a_flipped_bit_of_the_picture_is_one_bit(active: Bench) -> None:
    check_right(active)
    place = PICTURES_AT[active.board.program._camera.latest]
    number = 77
    active.client.command("ImageBlockSet", BlockNumber=number)
    active.client.wait_processed(1)
    before = bytes(active.telemetry("ImageBlock")["Block"])
    active.inject("memory-flip", target="sdram", address=place + 128 * number + 5, bit=6)
    after = bytes(active.telemetry("ImageBlock")["Block"])
    assert after == before[:5] + bytes([before[5] ^ 0x40]) + before[6:]
    assert active.flags() == set()
    check_right(active)


@pytest.mark.fault("memory-upsets")
def test_upsets_of_the_flash_are_corrected_as_it_is_reloaded(active: Bench) -> None:
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
    check_right(active)


@pytest.mark.fault("memory-upsets")
def test_upsets_of_the_ram_are_found_before_the_catalogue_is_used(active: Bench) -> None:
    active.inject("memory-upsets", target="sdram", rate=1e-6)
    active.client.pause(2)
    active.faults.clear()
    assert len(active.faults.log) > 100
    check_right(active)
    assert active.flags() == {"RamError"}


@pytest.mark.fault("latch-up")
def test_a_latched_camera_draws_on_until_the_host_acts(active: Bench) -> None:
    usual_ma = current_ma(active)
    active.inject("latch-up", extra_ma=LATCHED_MA)
    assert current_ma(active) == pytest.approx(usual_ma + LATCHED_MA, abs=1)
    check_right(active)
    assert active.flags() == set()  # whoever watches the current decides
    switch(active, LatchUpStep.OFF)
    assert current_ma(active) == 0
    assert active.device.measure().reason is Reason.CAMERA_OFF
    switch(active, LatchUpStep.ON)
    assert current_ma(active) == pytest.approx(usual_ma, abs=1)
    check_right(active)


@pytest.mark.fault("latch-up")
def test_a_lasting_latch_up_comes_back_with_each_switching_on(active: Bench) -> None:
    usual_ma = current_ma(active)
    active.inject("latch-up", lasting=True, extra_ma=LATCHED_MA)
    for step in (LatchUpStep.OFF, LatchUpStep.ON):
        switch(active, step)
    assert current_ma(active) == pytest.approx(usual_ma + LATCHED_MA, abs=1)


def test_a_bit_of_its_memories_can_not_stick(tracker: Bench) -> None:
    with pytest.raises(FaultError, match="only memories of a device with an FPGA"):
        tracker.inject("memory-stuck")
