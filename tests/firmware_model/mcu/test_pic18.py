import pytest

from cubestack.firmware_model.mcu.pic18 import (
    FITTED_SUN_SECONDS,
    LIBRARY_FACTOR,
    PIC18F45K20,
    pic18f45k20,
)


def test_only_the_floating_point_library_is_fitted_and_by_one_factor() -> None:
    fitted = {n for n, c in PIC18F45K20.operations.items() if c.provenance == "fitted"}
    assert fitted == {name for name in PIC18F45K20.operations if name.startswith("f32_")}
    plain = pic18f45k20(1.0).operations
    for name, cost in PIC18F45K20.operations.items():
        factor = LIBRARY_FACTOR if name in fitted else 1
        assert cost.cycles == round(plain[name].cycles * factor), name


def test_the_instruction_clock_is_that_of_the_published_timer_formula() -> None:
    # 4 tenths of the timer's period at the prescaler of 256, CubeSense thesis, equation 7.4.1
    assert PIC18F45K20.seconds(256 * 1000) == pytest.approx(1000 * 256 / 5e6)


def test_the_sun_sensor_s_published_time_leaves_so_much_for_the_processor() -> None:
    assert pytest.approx(0.0224) == FITTED_SUN_SECONDS
