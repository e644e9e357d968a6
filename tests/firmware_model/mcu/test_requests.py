from cubestack.firmware_model.mcu.flash_store import FlashStore


def test_a_flash_page_keeps_what_was_written_last() -> None:
    flash = FlashStore()
    assert flash.read("a") is None
    data = bytearray(b"12")
    flash.write("a", data)
    data[0] = 0  # the page has a copy
    assert flash.read("a") == b"12"
    flash.write("a", b"3")
    assert flash.read("a") == b"3"
    assert flash.read("b") is None


def test_erasing_a_page_leaves_the_others() -> None:
    flash = FlashStore()
    flash.write("a", b"1")
    flash.write("b", b"2")
    flash.erase("a")
    flash.erase("never written")
    assert flash.read("a") is None
    assert flash.read("b") == b"2"


def test_writes_are_counted_page_by_page() -> None:
    flash = FlashStore()
    for page in "aba":
        flash.write(page, b"")
    flash.erase("a")
    flash.write("a", b"")
    assert flash.writes == {"a": 3, "b": 1}
