"""Log a device's results to a CSV file: time, attitude or angles, and their quality.

TARGET is as in `cubestack shell`: a serial port, tcp://HOST:PORT, i2c:BUS:ADDR,
emulated:DEVICE... A log only reads results; -c runs shell commands at the start,
--each before every line. At the end it prints the scatter of each angle about a
straight line.

examples:
  cubestack log /dev/ttyUSB0 --device {first} --out night.csv
  cubestack log emulated:{first} --scene night.toml --count 100 --out night.csv
      -c 'write setDetectionThresholds 16 16; write Trigger'
  cubestack log emulated:{second} --count 10 --each 'write CaptureAndDetect SUN SRAM1; time 0.5'
"""

import argparse
import csv
import sys
import time

from cubestack.firmware_model.values import number, whole
from cubestack.host.cli.arguments import add_output, add_value
from cubestack.host.cli.device_options import add_target_arguments, open_any_target
from cubestack.host.cli.shell import split_commands
from cubestack.host.clients.contract import Columns
from cubestack.host.devices.result_table import log_lines, scatter
from cubestack.host.errors import TargetError
from cubestack.host.output import Outputs
from cubestack.host.shell.language import Shell
from cubestack.host.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_target_arguments(parser)
    add_output(parser, "--out", "default: standard output", "FILE.csv")
    add_value(parser, "count", whole(None, "lines; default: until Ctrl-C", 1, metavar="N"))
    add_value(parser, "interval", number(1.0, "of the lines (default 1)", 0, 86_400, "s"))
    for option, name, when in (("-c", "first", "the first line"), ("--each", "each", "every line")):
        text = f"shell commands before {when}, separated by semicolons"
        parser.add_argument(option, dest=name, default="", metavar="COMMANDS", help=text)


def run(args: argparse.Namespace) -> int:
    """Log; returns 0 if every line has a result."""
    lines: list[Columns] = []
    with Outputs() as stack:
        target = stack.enter_context(open_any_target(args.target, args, keep=False))
        if target.device is None:
            raise TargetError(f"{args.target}: no registered device")
        client, shell = target.device.client(target.node), Shell(target)
        clock = time.monotonic if target.controls is None else target.controls.time_s

        def perform(commands: str) -> None:
            for command in split_commands(commands):
                shell.execute(command)

        perform(args.first)
        stream = stack.create(args.out) if args.out else sys.stdout
        writer: csv.DictWriter[str] | None = None
        try:
            for line in log_lines(
                client,
                clock,
                count=args.count,
                interval_s=args.interval,
                before_each=lambda: perform(args.each),
            ):
                target.outputs.keep()
                lines.append(line)
                if writer is None and line["error"] is None:
                    writer = csv.DictWriter(stream, list(line))
                    writer.writeheader()
                    stack.keep()
                    writer.writerows(lines[:-1])
                if writer is not None:
                    writer.writerow(line)
                    stream.flush()
        except KeyboardInterrupt:
            pass
    for column, (slope, sigma, count) in scatter(lines).items():
        say(
            f"{column}: {sigma:.4f} deg (1 sigma) about a straight line of {slope:+.5f} deg/s, "
            f"{count} of {len(lines)} lines"
        )
    wrong = [line for line in lines if line["error"] is not None]
    if wrong:
        say(
            f"{len(wrong)} of {len(lines)} lines have no result, the last one: {wrong[-1]['error']}"
        )
    return 1 if wrong else 0
