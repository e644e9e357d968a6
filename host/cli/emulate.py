"""Serve emulated devices until Ctrl-C; any program can open their ports.

A CubeSense has two serial lines: the node protocol on PATH or PORT, the bench
protocol on PATH.bench or PORT + 1. Several devices take ports one after the
other, and share one I2C bus.

examples:
  cubestack emulate cubestar --pty ./ttyCUBESTAR
      then, in a second terminal:
      .venv/bin/python examples/plain_pyserial.py ./ttyCUBESTAR
  cubestack emulate cubestar --scene sky.toml --tcp 4000 --pace fast
  cubestack emulate cubestar --tcp 4000 --layout two-boards
  cubestack emulate cubesense --pty ./ttyCUBESENSE --record session.jsonl
  cubestack emulate cubestar cubesense aramis --i2c 7
      then: cubestack run --attach -- i2cdetect -y 7
"""

import argparse
import signal
import time
from contextlib import ExitStack
from pathlib import Path

from cubestack.firmware_model.formats.linux_i2c import socket_path
from cubestack.firmware_model.formats.setup import Option
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.cli.arguments import whole
from cubestack.host.cli.fault_plan import add_faults_argument, inject_plan
from cubestack.host.cli.ports import add_port_arguments, open_ports
from cubestack.host.cli.records import add_record_arguments, record
from cubestack.host.cli.session import add_engine_arguments, add_layout_argument, tell_layout
from cubestack.host.cli.terminal import say
from cubestack.host.devices.boards import DEVICES, open_board
from cubestack.host.recording.setups import emulated_setup

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "devices", nargs="+", choices=DEVICES, metavar="device", help=", ".join(DEVICES)
    )
    parser.add_argument(
        "--scene",
        type=Path,
        metavar="FILE",
        help="TOML scene of the one device; default: Orion, or Earth and Sun",
    )
    add_port_arguments(parser)
    parser.add_argument(
        "--i2c", type=whole(0, 255), metavar="BUS", help="I2C bus, for cubestack run --attach"
    )
    parser.add_argument("--baud", type=whole(1), help="of the node protocol; default 57600")
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="seed of everything random (default 0)"
    )
    add_faults_argument(parser)
    add_engine_arguments(parser)
    add_layout_argument(parser)
    parser.add_argument(
        "--mcu-addressing",
        action="store_true",
        help="cubesense: FPGAs that let the processor choose addresses (telecommand 100)",
    )
    parser.add_argument(
        "--pace",
        choices=("real", "fast"),
        default="real",
        help="real: virtual time is wall time; fast: ahead while there is work",
    )
    add_record_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM."""
    from cubestack.emulator.bus.i2c import I2cBus
    from cubestack.emulator.i2cdev.adapter import I2cAdapter
    from cubestack.emulator.ports.realtime import RealtimeScheduler, wait_ready
    from cubestack.emulator.sim.virtual_time import Kernel

    if len(set(args.devices)) < len(args.devices):
        raise ValueError(f"name each device once: {' '.join(args.devices)}")
    if len(args.devices) > 1:
        for name in ("scene", "faults", "record", "trace"):
            if getattr(args, name) is not None:
                raise ValueError(f"--{name} belongs to one device, and there are several")
    with ExitStack() as stack:
        kernel = Kernel()
        i2c_bus = I2cBus(kernel)
        devices = []
        for name in args.devices:
            devices.append(
                open_board(
                    name,
                    args.scene,
                    seed=args.seed,
                    engine=args.engine,
                    baud=args.baud,
                    mcu_addressing=args.mcu_addressing,
                    layout=args.layout,
                    kernel=kernel,
                    i2c_bus=i2c_bus,
                )
            )
            stack.callback(devices[-1].board.close)
        tell_layout(args.layout, say)
        if len(devices) == 1:
            inject_plan(devices[0].board.faults, args.faults, say)
            options: dict[str, Option] = {"mcu_addressing": True} if args.mcu_addressing else {}
            if args.layout is not Layout.COPIED:
                options["layout"] = args.layout.value
            setup = emulated_setup(args.seed, args.scene, args.faults, options)
            record(args, devices[0], stack, setup)
        adapter = I2cAdapter(kernel, devices[0].board.i2c_bus)  # what records has taken its place
        served = open_ports(args, devices, stack)
        endpoints = [endpoint for _, _, endpoint in served]

        def devices_busy() -> bool:
            return any(device.board.busy() for device in devices)

        wait, clock_ns = wait_ready, time.monotonic_ns
        if args.i2c is not None:
            from cubestack.emulator.i2cdev.pacing import sharpen_timers, wait_precisely
            from cubestack.emulator.i2cdev.scheduler import I2cScheduler
            from cubestack.emulator.i2cdev.server import I2cServer

            server = I2cServer(socket_path(args.i2c), adapter)
            stack.callback(server.close)
            turns = I2cScheduler(
                server.name, kernel, adapter, [server], devices_busy, fast=args.pace == "fast"
            )
            stack.callback(turns.close)
            endpoints.append(turns)
            sharpen_timers()
            wait, clock_ns = wait_precisely, turns.clock_ns

        pump = RealtimeScheduler(
            kernel,
            endpoints,
            lambda: adapter.busy or devices_busy(),
            pace=args.pace,
            report=say,
            clock_ns=clock_ns,
            wait=wait,
        )
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: pump.stop())
        for device in devices:
            ports = [
                f"{endpoint.name} at {line.baud} baud"
                if not line.suffix
                else f"{line.title} on {endpoint.name} at {line.baud} baud"
                for owner, line, endpoint in served
                if owner is device
            ]
            say(f"{device.title} serves on {', '.join(ports)}; Ctrl-C ends it")
        if args.i2c is not None:
            say(f"I2C bus {args.i2c}: cubestack run --attach --bus {args.i2c} -- PROGRAM")
        pump.run()
    return 0
