import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface import aramis as codes
from cubestack.firmware_model.interface.aramis import CatalogueState, LatchUpStep, Reason
from tests.tiers import quick

from .conftest import ORION, Desk


def test_aramis_activates_measures_and_deactivates(desk: Desk) -> None:
    desk.client.pause(0.1)
    status = desk.client.telemetry("SensorStatus")
    assert (status["State"], status["Catalogue"]) == (codes.SensorState.INACTIVE, 0)
    assert not desk.board.camera.enabled
    assert desk.aramis.activate() is CatalogueState.GOOD
    assert desk.board.camera.enabled
    found = desk.aramis.measure()
    ways = codes.MeasurementOutcome.CONCLUSIVE, codes.MeasurementMode.LOST_IN_SPACE
    assert (found.valid, found.outcome, found.mode) == (True, *ways)
    cross, roll = desk.error_deg()
    assert cross < 0.01
    assert abs(roll) < 0.05
    desk.aramis.deactivate()
    assert not desk.board.camera.enabled
    assert desk.client.telemetry("SensorStatus")["State"] == codes.SensorState.INACTIVE
    assert desk.flags() == set()


def test_measurement_without_activation_is_reported(desk: Desk) -> None:
    found = desk.aramis.measure()
    assert (found.valid, found.reason, found.quaternion) == (False, Reason.NOT_ACTIVE, None)
    assert desk.flags() == {"NotActive"}
    desk.command("StartLoop", Period=1000, Mode=0)
    assert desk.client.telemetry("LoopStatus")["Running"] == 0


def test_measure_accepts_a_rough_direction_as_vector_or_angles(active: Desk) -> None:
    boresight = np.array([0.104, 0.994, -0.017])
    for near in ({"near": boresight}, {"near_rad": (1.466, -0.017)}):
        found = active.aramis.measure(**near)  # type: ignore[arg-type]
        assert (found.valid, found.mode) == (True, codes.MeasurementMode.AIDED)
        assert active.error_deg()[0] < 0.01
    away = active.aramis.measure(near=-boresight)
    assert (away.valid, away.outcome) == (False, codes.MeasurementOutcome.NONE)
    assert away.quaternion is not None  # an older one, marked as such
    with pytest.raises(ValueError, match="not both"):
        active.aramis.measure(boresight, near_rad=(0.0, 0.0))


def test_attitude_answer_has_the_time_of_the_image(active: Desk) -> None:
    assert active.aramis.julian_date() is None
    assert active.aramis.measure().julian_date is None
    active.aramis.set_time(2_461_366.75)
    set_at_s = active.now_s
    found = active.aramis.measure()
    exposed_s = active.board.ppi.stored.mid_exposure_ps(511.5) / PS_PER_S
    assert found.image_uptime_s == pytest.approx(exposed_s, abs=0.0011)
    seconds = (found.julian_date - 2_461_366.75) * codes.MS_PER_DAY / 1000
    assert seconds == pytest.approx(exposed_s - set_at_s, abs=0.03)
    now = active.aramis.julian_date()
    assert (now - 2_461_366.75) * 86_400 == pytest.approx(active.now_s - set_at_s, abs=0.03)


def test_body_attitude_includes_the_loaded_body_rotation(active: Desk) -> None:
    turn = Rotation.from_euler("xyz", [20, -40, 75], degrees=True)
    assert active.aramis.body_quaternion() is None
    active.aramis.measure()
    plain, camera = active.aramis.body_quaternion(), active.aramis.attitude().quaternion
    np.testing.assert_allclose(plain, camera, atol=1e-6)
    active.aramis.set_body_rotation(turn.as_quat().tolist())
    body = active.aramis.body_quaternion()
    expected = turn * Rotation.from_quat(camera)
    assert (Rotation.from_quat(body).inv() * expected).magnitude() < 1e-6
    active.client.command("Reset")
    active.client.pause(0.3)
    assert active.client.telemetry("BodyRotation")["Q2"] == pytest.approx(turn.as_quat()[2])
    assert active.client.telemetry("ExtendedIdentification")["ResetCause"] == 2


def test_latch_up_action_switches_the_camera_supply(active: Desk) -> None:
    assert active.client.telemetry("SupplyStatus")["Current"] == 110.0
    active.board.power.latch_up("camera", 300.0)
    assert active.client.telemetry("SupplyStatus")["Current"] == 410.0
    active.client.command("LatchUpAction", Step=LatchUpStep.OFF)
    assert active.client.telemetry("SupplyStatus") == {"Switch": 0, "Current": 0.0}
    found = active.aramis.measure()
    assert (found.valid, found.reason) == (False, Reason.CAMERA_OFF)
    active.command("LatchUpAction", Step=LatchUpStep.ON)
    assert active.client.telemetry("SupplyStatus") == {"Switch": 1, "Current": 110.0}
    assert active.aramis.measure().valid


def test_supply_is_cut_immediately_even_during_a_measurement(active: Desk) -> None:
    active.client.command("GetAttitude")
    before = active.now_s
    active.client.command("LatchUpAction", Step=LatchUpStep.OFF)
    assert not active.board.camera.running
    assert active.now_s - before < 0.01
    active.client.wait_processed(5)
    assert active.aramis.attitude().reason is Reason.CAMERA_OFF
    active.aramis.latch_up_action()
    assert active.aramis.measure().valid


def test_a_catalogue_is_loaded_by_telecommand() -> None:
    small = build_database(CatalogueParameters(step_deg=10, stars_per_field=3, mag_limit=3.0))
    desk = Desk(with_catalogue=False)
    assert desk.aramis.activate() is CatalogueState.MISSING
    assert desk.aramis.measure().reason is Reason.NO_CATALOGUE
    assert "CatalogueMissing" in desk.flags()
    image = small.pack()
    seen: list[tuple[int, int]] = []
    state = desk.aramis.load_catalogue(image, lambda done, total: seen.append((done, total)))
    assert state is CatalogueState.GOOD
    assert seen[-1] == (-(-len(image) // 128),) * 2
    expected = {"Stars": len(small.numbers), "Triangles": len(small), "Bytes": len(image)}
    assert desk.client.telemetry("CatalogueStatus").items() >= expected.items()
    desk.aramis.deactivate()
    assert desk.aramis.activate() is CatalogueState.GOOD


def test_rejected_upload_keeps_the_catalogue(active: Desk) -> None:
    for checksum, numbers in (
        (0xD8EF_0F4A, range(3)),  # any checksum
        (0x6B86_8B3A, range(2)),  # a block is missing
        (0xD8EF_0F4A, range(2, 4)),  # a stray block
    ):
        active.client.command("ClearErrorFlags")
        active.client.command("BeginCatalogue", Length=300, Checksum=checksum)
        for number in numbers:
            active.command("CatalogueBlock", BlockNumber=number, Data=bytes(128))
        active.command("CommitCatalogue")
        assert active.flags() == {"UploadError"}
    active.command("CommitCatalogue")
    assert active.client.telemetry("UploadStatus")["Blocks"] == 3
    assert active.aramis.measure().valid


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
    expected = False, codes.MeasurementOutcome.NONE, Reason.CATALOGUE_DAMAGED
    assert (found.valid, found.outcome, found.reason) == expected
    assert desk.client.telemetry("CatalogueStatus")["Lost"] == 1
    assert "CatalogueDamaged" in desk.flags()


def test_upsets_in_ram_are_found_before_the_next_match(active: Desk) -> None:
    active.board.irradiate("sdram", 1e-6)
    assert active.aramis.measure().valid
    assert active.error_deg()[0] < 0.01
    assert active.flags() == {"RamError"}
    assert active.client.telemetry("CatalogueStatus")["RamErrors"] == 1


def test_catalogue_is_reloaded_periodically_and_can_be_refreshed(active: Desk) -> None:
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


@pytest.mark.parametrize("seed", quick(range(6), 3))
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
