"""Starting programs: routes that are not there say why."""

import errno
import os
from unittest.mock import Mock

import pytest

from cubestack.emulator.i2cdev import guest_process as program
from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.seccomp.filter import native_abi

needs_abi = pytest.mark.skipif(native_abi() is None, reason="no filter for this machine")


def start(*command: str) -> None:
    nobody = Mock(side_effect=AssertionError("nobody opens a device file here"))
    program.start_filtered(command, {}, DeviceNode(7), nobody)


def test_an_unknown_machine(monkeypatch):
    monkeypatch.setattr(program, "native_abi", lambda: None)
    with pytest.raises(program.RouteError, match=r"system calls of .* are not supported"):
        start("true")


@needs_abi
def test_memory_out_of_reach(monkeypatch):
    refuse = Mock(side_effect=PermissionError(errno.EPERM, os.strerror(errno.EPERM)))
    monkeypatch.setattr(program, "read_memory", refuse)
    with pytest.raises(program.RouteError, match=r"no access to the program's memory \(Operation"):
        start("true")


@needs_abi
def test_a_filter_that_the_kernel_does_not_take(monkeypatch):
    monkeypatch.setattr(program, "make_filter", lambda _abi, _numbers: bytes(8))
    with pytest.raises(program.RouteError, match=r"the kernel refuses a seccomp listener \("):
        start("true")


def test_exit_codes(tmp_path):
    for script, code in (("exit 3", 3), ("kill -9 $$", 128 + 9)):
        running = program.start_preloaded(["sh", "-c", script], {}, tmp_path / "none.so")
        assert (running.exit_code, running.ended, running.watched()) == (code, True, [])
        running.close()


def test_rejects_programs_that_cannot_be_preloaded(tmp_path, monkeypatch):
    with pytest.raises(program.RouteError, match="has a blank or colon"):
        program.start_preloaded(["sh"], {}, tmp_path / "a b.so")
    monkeypatch.setattr(program, "is_static", lambda _path: True)
    with pytest.raises(program.RouteError, match=r"sh is linked statically, so no library"):
        program.start_preloaded(["sh"], {}, tmp_path / "none.so")
