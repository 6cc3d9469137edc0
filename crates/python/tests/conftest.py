"""What several tests need."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import stickslip

ROOT = Path(__file__).resolve().parents[3]

#: Numbers of the couple of Pust, Pesek, Radolfova (2015), Sec. 4.
MASS, STIFFNESS, DAMPING, CONTACT, LIMIT, FORCE = 0.182, 105_103.0, 0.2, 1e4, 2.0, 10.0


def couple(law=None):
    """Two blades, of which the first is driven, and what rubs between them."""
    model = stickslip.Model()
    for blade in ("blade1", "blade3"):
        model.mass(blade, MASS)
        model.spring(blade, "ground", stiffness=STIFFNESS, damping=DAMPING)
    model.joint("shroud", "blade1", "blade3", law or stickslip.law("jenkins", stiffness=CONTACT, limit=LIMIT))
    model.force("blade1", FORCE)
    return model


@pytest.fixture(scope="session")
def command():
    """Runs the command; without one that was built the tests that hold the package against it are skipped."""
    built = [os.environ.get("STICKSLIP_COMMAND", ""), *(ROOT / "target" / profile / "stickslip" for profile in ("release", "debug"))]
    found = next((str(path) for path in built if path and Path(path).is_file()), None) or shutil.which("stickslip")
    if found is None:
        pytest.skip("the command was not built: cargo build --release, or STICKSLIP_COMMAND names it")

    def run(*arguments, check=True):
        return subprocess.run([found, *map(str, arguments)], capture_output=True, text=True, check=check)

    return run
