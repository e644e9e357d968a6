"""List the firmware's buffers against the memories of CubeSense's processor:
1536 bytes of RAM, 32 kB of flash.

example:
  cubestack memory cubesense --json
"""

import argparse
import json

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=("cubesense",), help="device whose memories are listed")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the budget; returns 1 when a memory is too small for it."""
    from cubestack.firmware_model.cubesense.memory import CAPACITY, budget, report, used

    buffers = budget()
    totals = used(buffers)
    if args.json:
        memories = {
            memory.value: {
                "bytes": CAPACITY[memory],
                "used": total,
                "buffers": {b.name: b.size for b in buffers if b.memory is memory},
            }
            for memory, total in totals.items()
        }
        print(json.dumps(memories))
    else:
        print(report())
    return int(any(total > CAPACITY[memory] for memory, total in totals.items()))
