from cubestack.firmware_model.mcu.memory import FlashStore


def test_pages_keep_what_was_written_last_and_their_writes_are_counted() -> None:
    flash = FlashStore()
    data = bytearray(b"12")
    for page, contents in (("a", b"0"), ("b", b"2"), ("a", data)):
        flash.write(page, contents)
    data[0] = 0  # the page has a copy
    assert [flash.read(page) for page in "abc"] == [b"12", b"2", None]
    flash.erase("a")
    flash.erase("never written")
    assert [flash.read(page) for page in "abc"] == [None, b"2", None]
    flash.write("a", b"3")
    assert flash.read("a") == b"3"
    assert flash.writes == {"a": 3, "b": 1}
