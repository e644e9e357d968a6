"""Measure a registered device, from a program."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.host.devices.device import AnyDevice, BoardOption, Engine
from cubestack.host.devices.experiment import AnyExperiment, Result
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import AnyEmulated, check_options, scene_options
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options

MEASURE = "measure"
"""Name of the command that all devices have."""


def measure(
    name: str,
    *,
    progress: Callable[[int, int], None] | None = None,
    engine: Engine = "auto",
    command: str = MEASURE,
    opened: Callable[[AnyEmulated], object] = lambda _emulated: None,
    **options: Any,
) -> Iterator[Result]:
    """Measure a device end to end; yields each result beside the truth.

    Args:
        name: of the device, one of ``device_names()``.
        progress: called with the number of results so far, and of all.
        engine: how its FPGA is run.
        opened: called with each device after power-up.
        command: another one that the device has, such as ``upsets``.
        options: as `cubestack measure NAME --help` has them, with underscores: ``frames=20``,
            ``mag_limit=3.8``, ``no_noise=True``; options of its board among them.

    Raises:
        TargetError: no device has that name.
        ValueError: an unknown command or option, or an invalid value; the text says what is valid.
    """
    device = registered(name)
    experiment = experiment_of(device, command)
    own = {one: value for one, value in options.items() if one in experiment.options.declared()}
    board = {one: value for one, value in options.items() if one not in own}
    known = board_options(device, experiment)
    for one in board:
        if one not in known:
            every = ", ".join([*experiment.options.declared(), *known])
            raise ValueError(f"{command} has no option {one!r} for {device.name}; known: {every}")
    check_options(device, board)
    checked = experiment.options(**own)
    board = board_as_said(device, checked, board)
    results = experiment.run(Opener(device, engine, board, opened=opened), checked)
    return results if progress is None else _counted(results, experiment.count(checked), progress)


def experiment_of(device: AnyDevice, command: str = MEASURE) -> AnyExperiment:
    """The experiment of ``measure`` or another command; raises ValueError if there is none."""
    if command != MEASURE:
        found = {report.name: report for report in device.reports}
        if command not in found:
            names = ", ".join([MEASURE, *found])
            raise ValueError(f"{device.name} has no command {command!r}, only {names}")
        return found[command].load()
    if device.experiment is None:
        raise ValueError(f"there is no experiment for {device.name}")
    return device.experiment()


def board_options(device: AnyDevice, experiment: AnyExperiment) -> Mapping[str, BoardOption]:
    options = device.all_options if experiment.powers_up else ()
    return {
        one.name: one for one in options if one.name not in experiment.decides and not one.serves
    }


def board_as_said(device: AnyDevice, options: Options, given: Mapping[str, Any]) -> dict[str, Any]:
    """Board options: the given ones, and those of the scene file."""
    return scene_options(device, getattr(options, "scene", None)) | dict(given)


def running(
    device: AnyDevice, experiment: AnyExperiment, board: Mapping[str, Any]
) -> dict[str, Any]:
    """Entries of each result: the firmware or profile, and switches that differ from it."""
    if "profile" not in board_options(device, experiment):
        return {}
    if board.get("firmware"):
        return {"firmware": str(board["firmware"])}
    profile = board.get("profile", DEFAULT_PROFILE)
    switches = device.switches.of(profile, board.get("set", "")).differences(profile)
    return {"profile": profile, **({"switches": switches} if switches else {})}


def _counted(
    results: Iterator[Result], total: int, progress: Callable[[int, int], None]
) -> Iterator[Result]:
    for done, result in enumerate(results, start=1):
        progress(done, total)
        yield result
