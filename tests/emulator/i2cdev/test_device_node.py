import ctypes
import os
import stat
import struct

import pytest

from cubestack.emulator.i2cdev.device_node import DeviceNode, Found

NODE = DeviceNode(7)


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/dev/i2c-7", Found.DEVICE),
        ("/dev/./i2c-7", Found.DEVICE),
        ("//dev/../dev/i2c-7", Found.DEVICE),
        ("/proc/bus/i2c", Found.LISTING),
        ("/dev/i2c-77", None),
        ("/dev/i2c-", None),
        ("/var/i2c-7", None),
        ("/dev/shm/../xi2c-7", None),
        ("/dev/xi2c-7", None),
        ("i2c-7", None),
        ("", None),
    ],
)
def test_device_paths_are_recognised(path, found):
    assert NODE.find(path, os.getpid(), None) is found


def test_relative_device_paths_are_recognised(monkeypatch):
    monkeypatch.chdir("/dev")
    assert NODE.find("i2c-7", os.getpid(), None) is Found.DEVICE
    assert NODE.find("./i2c-7", os.getpid(), -100) is Found.DEVICE
    folder = os.open("/", os.O_RDONLY)
    try:
        assert NODE.find("dev/i2c-7", os.getpid(), folder) is Found.DEVICE
        assert NODE.find("i2c-7", os.getpid(), folder) is None
    finally:
        os.close(folder)
    assert NODE.find("i2c-7", os.getpid(), 9999) is None


def test_symbolic_links_to_the_device_are_followed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    targets = {
        "bus": "/dev/i2c-7",
        "chain": "bus",
        "loop": "loop",
        "dev": "/dev",
        "other": "/dev/x",
    }
    for name, target in targets.items():
        (tmp_path / name).symlink_to(target)
    for path in ("bus", "chain", "./chain", f"{tmp_path}/chain", "dev/i2c-7"):
        assert NODE.find(path, os.getpid(), None) is Found.DEVICE, path
    for path in ("loop", "other", "missing", "dev"):
        assert NODE.find(path, os.getpid(), None) is None, path
    assert NODE.find("bus", os.getpid(), None, follow=False) is None
    assert NODE.find("dev/i2c-7", os.getpid(), None, follow=False) is Found.DEVICE


@pytest.mark.parametrize(
    ("path", "process", "fd"),
    [
        ("/proc/self/fd/5", 77, 5),
        ("/proc/thread-self/fd/5", 77, 5),
        ("/dev/fd/12", 77, 12),
        ("/dev/stdin", 77, 0),
        ("/proc/99/fd/3", 99, 3),
        ("/proc/99/task/100/fd/3", 99, 3),
    ],
)
def test_links_in_proc_to_an_opened_device_are_followed(path, process, fd):
    asked = []

    def is_ours(*place):
        asked.append(place)
        return True

    assert NODE.find(path, 77, None, is_ours=is_ours) is Found.DEVICE
    assert NODE.is_own_link(path, 77, is_ours)
    assert asked == [(process, fd)] * 2
    assert NODE.find(path, 77, None, follow=False, is_ours=is_ours) is None


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_void_p) != 8, reason="structures of 64-bit machines")
def test_stat_structure_has_the_kernel_layout():
    """The fields of a real struct stat, found at their places in the one made up."""
    made = NODE.stat(compact=False)
    device, inode, links, mode, owner, group, _, number = struct.unpack_from("=QQQIIIIQ", made)
    assert device == os.stat("/dev").st_dev
    assert (links, owner, group) == (1, os.getuid(), os.getgid())
    assert stat.S_ISCHR(mode)
    assert (os.major(number), os.minor(number)) == (89, 7)
    compact, extended = NODE.stat(compact=True), NODE.statx()
    assert (len(made), len(compact), len(extended)) == (144, 128, 256)
    assert struct.unpack_from("=QQIIIIQ", compact) == (device, inode, mode, 1, owner, group, number)


class _Statx(ctypes.Structure):
    """By statx(2)."""

    _fields_ = (
        *((name, ctypes.c_uint32) for name in ("mask", "blksize")),
        ("attributes", ctypes.c_uint64),
        *((name, ctypes.c_uint32) for name in ("nlink", "uid", "gid")),
        ("mode", ctypes.c_uint16),
        *((name, ctypes.c_uint64) for name in ("ino", "size", "blocks", "attributes_mask")),
        ("times", ctypes.c_uint64 * 8),
        *((name, ctypes.c_uint32) for name in ("rdev_major", "rdev_minor", "major", "minor")),
        ("spare", ctypes.c_uint64 * 14),
    )


def test_statx_equals_that_of_a_real_device() -> None:
    real, made = _Statx(), _Statx.from_buffer_copy(NODE.statx())
    basic = 0x7FF
    assert ctypes.CDLL(None).statx(-100, b"/dev/null", 0, basic, ctypes.byref(real)) == 0
    same = ("blksize", "nlink", "size", "blocks")
    assert [getattr(made, name) for name in same] == [getattr(real, name) for name in same]
    assert stat.S_IFMT(made.mode) == stat.S_IFMT(real.mode)
    assert struct.unpack_from("=I", NODE.stat(compact=True), 16) == (made.mode,)
    assert (made.mask, made.attributes, made.attributes_mask) == (basic, 0, 0)
    assert (made.uid, made.gid) == (os.getuid(), os.getgid())
    folder = os.stat("/dev").st_dev
    assert (made.major, made.minor) == (os.major(folder), os.minor(folder))
    assert (made.rdev_major, made.rdev_minor) == (89, 7)
    for compact in (False, True):
        text = NODE.stat(compact=compact)
        size, blocks = struct.unpack_from("=q", text, 48)[0], struct.unpack_from("=q", text, 64)[0]
        block = struct.unpack_from("=i" if compact else "=q", text, 56)[0]
        assert (size, block, blocks) == (0, real.blksize, 0)
        assert struct.unpack_from("=Q", text, 8)[0] == made.ino
    assert DeviceNode(8).statx() != NODE.statx()


def test_device_node_listing_has_the_i2c_tools_format():
    number, kind, name, _ = NODE.listing.split("\t")
    assert (number, kind.strip()) == ("i2c-7", "i2c")
    assert "cubestack" in name
