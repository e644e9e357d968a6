"""Studies: commands that use the emulator to measure, compare or show something.

An entry point in the group ``cubestack.commands`` registers them; the emulator imports none.
"""

from cubestack.host.cli.commands import STUDIES, Command

_HERE = "cubestack.host.studies"

COMMANDS = {
    name: Command(STUDIES, summary, f"{_HERE}.{module}")
    for name, module, summary in (
        ("demo", "demo", "run the devices end to end, with pictures (`make run`)"),
        ("fidelity", "fidelity.command", "measure every published figure, in both profiles"),
        ("hazards", "hazards.command", "count right, refused and wrong results in hard skies"),
        (
            "compare",
            "compare.command",
            "compare the algorithms that the theses weigh, on the same skies",
        ),
        ("campaign", "campaign.command", "measure thousands of skies, resumable, on all cores"),
        ("powerfail", "powerfail.command", "cut the power at every flash write; check what boots"),
        ("calibrate", "calibrate", "fit a camera's lens to pictures of stars or lights"),
        ("costs", "costs", "count the cycles of a device's program as compiled code"),
        ("picture", "picture", "render what a star tracker sees at a known attitude"),
        ("log", "log", "log a device's results to a CSV file"),
        ("bench", "bench", "measure the cost of the hot paths on this machine"),
    )
}
