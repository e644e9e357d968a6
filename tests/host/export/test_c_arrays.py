import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.host.export.c_header import c_arrays
from tests.conftest import Run

DUMP = """
#include <stdio.h>
#include "catalogue.c"
#define PUT(array) fwrite(array, 1, sizeof array, stdout)
int main(void)
{
    if (CATALOGUE_STAR_COUNT != 405 || CATALOGUE_PAIR_ANGLE_COUNT != CATALOGUE_PAIR_FIRST_COUNT)
        return 1;
    PUT(catalogue_star), PUT(catalogue_star_x), PUT(catalogue_star_y), PUT(catalogue_star_z);
    PUT(catalogue_pair_first), PUT(catalogue_pair_second), PUT(catalogue_pair_angle);
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_compiled_arrays_equal_the_onboard_catalogue(run: Run, tmp_path: Path) -> None:
    catalogue = tmp_path / "catalogue.c"
    code, _, err = run("catalogue", "cubestar", "--pair-limit", "42.1", "--c", str(catalogue))
    assert (code, err) == (0, "")
    (tmp_path / "dump.c").write_text(DUMP)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
    program = str(tmp_path / "dump")
    subprocess.run(["cc", *flags, "-o", program, str(tmp_path / "dump.c")], check=True)
    found = subprocess.run([program], check=True, capture_output=True).stdout
    assert found == onboard_catalogue(pair_limit_deg=42.1).to_bytes()
    assert catalogue.read_text().count("const ") == 7


def test_rejects_other_arrays_and_unwritable_files(run: Run) -> None:
    for array, wrong in ((np.zeros(3), " of u2, i2, u4, f4, not float64"), (np.eye(2), "")):
        with pytest.raises(ValueError, match=f"x must be one row{wrong}"):
            c_arrays("p", {"x": array}, "about")
    code, _, err = run("catalogue", "cubestar", "--c", "/no/such/folder/x.c")
    assert code == 2
    assert "can not write /no/such/folder/x.c" in err
