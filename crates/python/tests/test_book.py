"""The Python of the book runs, block by block, as it stands there."""

import re

import numpy as np
import pytest
from conftest import ROOT
from test_identify import COLUMNS, STUDY

import stickslip

BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def test_the_blocks_of_the_book_run(tmp_path, monkeypatch):
    for needed in ("pandas", "polars", "scipy"):
        pytest.importorskip(needed)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "couple.toml").write_text(stickslip.Study.from_template("blade-couple-massless").text)
    (tmp_path / "rig.toml").write_text(STUDY)
    blocks = BLOCK.findall((ROOT / "docs" / "src" / "python.md").read_text())
    assert len(blocks) >= 6
    stiffness = np.array([[3e4, 0, -1e4], [0, 2e4, 0], [-1e4, 0, 5e4]])
    names = {"mass": np.eye(3), "stiffness": stiffness, "damping": 1e-4 * stiffness}
    names |= dict(zip("uf", COLUMNS["rig.csv"].values()))
    for block in blocks:
        # this cluster does not exist; test_campaign.py starts one
        if "tcp://" in block:
            continue
        # blocks that use an earlier model refer to the couple
        if "model" in block and "stickslip.Model" not in block:
            names["model"] = stickslip.Study.from_text(EXAMPLE).model()
        exec(compile(block, "python.md", "exec"), names)  # noqa: S102
    assert 0 < names["spread"]["first"][1] < 1.2


EXAMPLE = """
schema = 1
[[mass]]
name = "a"
mass = "182 g"
[[mass]]
name = "b"
mass = "182 g"
[[spring]]
between = ["a", "ground"]
stiffness = "105103 N/m"
damping = "0.2 kg/s"
[[spring]]
between = ["b", "ground"]
stiffness = "105103 N/m"
damping = "0.2 kg/s"
[[joint]]
name = "shroud"
between = ["a", "b"]
law = { kind = "jenkins", stiffness = "10 N/mm", limit = "2 N" }
[[force]]
on = "a"
amplitude = "10 N"
[study]
kind = "response"
frequency = ["121 Hz"]
"""
