"""One orbit with a CubeStar and a CubeSense on one bus, each queried once per second over I2C.

python one_orbit.py ORBIT.toml FOLDER [SECONDS]. Writes results.csv with each result beside the
truth, and errors.png if matplotlib is installed, and prints the speed.
"""

import csv
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import cubestack
from cubestack.emulator.camera.common.view import View
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.orbit_file import load_orbit
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult
from cubestack.host.emulation.orbit import follow

COLUMNS = ("time_s", "shadow", "star_deg", "asked", "off_deg")


def scene_of(device: Any) -> Any:
    """The scene of a device, without the condition of its cameras."""
    return device.scene.scene if isinstance(device.scene, View) else device.scene


def off_deg(sense: Any, camera: Camera) -> float | None:
    """Error of a direction; None if none was found."""
    measured = sense.client.capture_and_detect(camera)
    if measured.detect != DetectResult.SUCCESS:
        return None
    target = CameraTarget.SUN if camera == Camera.SUN else CameraTarget.NADIR
    truth = scene_of(sense).truth(target, round(sense.time_s * PS_PER_S))
    a, b = (
        np.radians([measured.alpha_deg, measured.beta_deg]),
        np.radians([truth.alpha_deg, truth.beta_deg]),
    )
    return float(np.degrees(np.hypot(*(a - b))))


def star_deg(star: Any) -> float | None:
    """Total error of the latest attitude; None if it is not valid."""
    found = star.client.attitude()
    if not found.valid:
        return None
    truth = scene_of(star).truth(round(found.image_time_s * PS_PER_S))
    return float(np.hypot(*attitude_error_deg(found.quaternion, truth)))


def fly(path: Path, seconds: float) -> list[dict[str, Any]]:
    """One row per second: the star tracker runs its own loop, CubeSense's cameras take turns."""
    orbit, rows = load_orbit(path), list[dict[str, Any]]()
    with (
        cubestack.open_device("cubestar", profile="extended") as star,
        cubestack.open_device("cubesense", beside=star, profile="extended") as sense,
    ):
        follow(orbit, [star, sense])
        star.client.client.command("Trigger")
        star.wait(2.0 - star.time_s)
        while star.time_s < seconds:
            begun = star.time_s
            camera = Camera.SUN if len(rows) % 2 else Camera.NADIR
            found = off_deg(sense, camera)
            row = {"time_s": round(begun, 3), "shadow": round(orbit.surroundings(begun).shadow, 4)}
            star.wait(max(0.0, begun + 0.8 - star.time_s))  # its loop is idle then
            row |= {"asked": camera.name, "off_deg": found, "star_deg": star_deg(star)}
            rows.append(row)
            star.wait(max(0.0, begun + 1.0 - star.time_s))
    return rows


def errors(rows: list[dict[str, Any]]) -> dict[str, list[tuple[float, float | None]]]:
    """Times and errors by sensor; an error is None if there is no result."""
    found = {"star tracker, attitude": [(row["time_s"], row["star_deg"]) for row in rows]}
    for camera in ("SUN", "NADIR"):
        asked = [row for row in rows if row["asked"] == camera]
        found[f"{camera.lower()} sensor"] = [(row["time_s"], row["off_deg"]) for row in asked]
    return found


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Plot errors over time; grey where the Earth hides the Sun."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    times = np.array([row["time_s"] for row in rows])
    dark = np.array([row["shadow"] > 0.5 for row in rows])
    for place, (name, points) in enumerate(errors(rows).items(), 1):
        axes = figure.add_subplot(3, 1, place)
        axes.fill_between(
            times, 0, 1, where=dark, color="0.88", transform=axes.get_xaxis_transform()
        )
        known = [point for point in points if point[1] is not None]
        if known:
            axes.semilogy(*zip(*known, strict=True), ".", markersize=3)
        axes.set_ylabel(f"{name}\nerror [deg]")
        axes.set_xlim(times[0], times[-1])
    axes.set_xlabel("time on the orbit [s]; grey: the Earth hides the Sun")
    figure.savefig(path, dpi=110)


def main() -> None:
    if len(sys.argv) not in (3, 4):
        sys.exit("usage: python one_orbit.py ORBIT.toml FOLDER [SECONDS]")
    folder, seconds = Path(sys.argv[2]), float(sys.argv[3]) if len(sys.argv) > 3 else 5700.0
    folder.mkdir(parents=True, exist_ok=True)
    begun = time.process_time()
    rows = fly(Path(sys.argv[1]), seconds)
    took = time.process_time() - begun
    with (folder / "results.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    for name, points in errors(rows).items():
        off = [error for _, error in points if error is not None]
        told = f"{np.median(off):.4f}, 95 % {np.percentile(off, 95):.4f} deg" if off else "-"
        print(f"{name}: {len(off)} of {len(points)} found; error: median {told}")
    print(f"{seconds:g} s in {took:.0f} s of one core's time, {seconds / took:.1f} times real time")
    try:
        draw(rows, folder / "errors.png")
    except ImportError:
        print("no errors.png: matplotlib is not installed")


if __name__ == "__main__":
    main()
