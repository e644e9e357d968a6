"""What many skies cost: time and memory by their number, two workers, a cluster, a cloud.

``make bench-scale FRAMES="10 1000 10000" PRICE=0.05`` measures on this machine, which must be idle
for the figures of two workers. The cluster of eight is simulated, from its measured overhead.
"""

import argparse
import heapq
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from cubestack.host.studies.workers import performed

PLAN = 'device = "{device}"\nframes = {frames}\nseed = 1\n[grid]\n[options]\nmag_limit = 3.8\n'
MILLION = 1_000_000
BLOCK, WORKERS, JOBS = 100, 8, 400


class Cost(NamedTuple):
    """Of a campaign in processes of its own."""

    frames: int
    processor_s: float
    wall_s: float
    memory_mb: float  #: the largest process's

    def sky_ms(self, start: "Cost") -> float:
        """Processor time in ms of a further sky, beyond those of ``start``."""
        return 1000 * (self.processor_s - start.processor_s) / (self.frames - start.frames)


def campaign(device: str, frames: int, workers: int) -> Cost:
    """Run a campaign of one point."""
    with tempfile.TemporaryDirectory() as name:
        plan = Path(name) / "plan.toml"
        plan.write_text(PLAN.format(device=device, frames=frames), encoding="utf-8")
        call = [sys.executable, "-m", "cubestack", "-q", "campaign", str(plan), "--json"]
        call += ["--workers", str(workers), "--out", str(Path(name) / "found")]
        began_s = time.perf_counter()
        nothing = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
        child = os.posix_spawn(sys.executable, call, os.environ, file_actions=nothing)
        _, status, used = os.wait4(child, 0)
        wall_s = time.perf_counter() - began_s
    if status:
        raise RuntimeError(f"the campaign of {frames} frames ended with status {status}")
    return Cost(frames, used.ru_utime + used.ru_stime, wall_s, used.ru_maxrss / 1024)


def nothing(number: int) -> int:
    return number


def overhead_s() -> float:
    """Processor time of client and scheduler per job, with two workers that do nothing."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        address = cluster.scheduler_address
        list(performed(nothing, range(20), 1, address))
        began_s = time.process_time()
        list(performed(nothing, range(JOBS), 1, address))
        return (time.process_time() - began_s) / JOBS


def simulated_s(workers: int, blocks: int, block_s: float, job_s: float) -> float:
    """Wall time of a campaign: one scheduler hands out blocks, ``job_s`` each, to ``workers``."""
    free = [0.0] * workers
    scheduler = 0.0
    for _ in range(blocks):
        scheduler = max(scheduler, free[0]) + job_s
        heapq.heapreplace(free, scheduler + block_s)
    return max(free)


def million_price(sky_s: float, per_core_hour: float) -> float:
    """Price of a million skies, of ``sky_s`` of processor time each."""
    return MILLION * sky_s / 3600 * per_core_hour


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="scale", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("frames", nargs="*", type=int, default=[10, 1000, 10_000])
    parser.add_argument("--device", default="cubestar")
    parser.add_argument("--price", type=float, default=0.05, help="of a core for an hour")
    parser.add_argument("--one", action="store_true", help="without the run of two workers")
    args = parser.parse_args(argv)
    costs = []
    for frames in args.frames:
        costs.append(campaign(args.device, frames, 1))
        one = costs[-1]
        print(f"{frames} skies: {one.processor_s:.1f} s, {one.memory_mb:.0f} MB", flush=True)
    sky_s = costs[-1].sky_ms(costs[0]) / 1000
    print(f"a further sky: {1000 * sky_s:.1f} ms of processor time")
    if not args.one:
        both = campaign(args.device, args.frames[-1], 2)
        print(f"two workers: {costs[-1].wall_s / both.wall_s:.2f} times as fast as one")
    job_s, block_s = overhead_s(), BLOCK * sky_s
    blocks = MILLION // BLOCK
    alone_s = simulated_s(1, blocks, block_s, 0.0)
    gain = alone_s / simulated_s(WORKERS, blocks, block_s, job_s)
    print(f"a Dask cluster needs {1000 * job_s:.1f} ms per block: {WORKERS} workers, {gain:.2f}")
    print(f"a million skies: {alone_s / 3600:.1f} core hours", end="")
    print(f", {million_price(sky_s, args.price):.2f} at {args.price:g} per core and hour")
    return 0


if __name__ == "__main__":
    sys.exit(main())
