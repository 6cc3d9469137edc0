"""Every docstring runs; every public name has one, and a type."""

import ast
import doctest
import inspect
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import stickslip
from stickslip import _campaign, _core, _dual, _folder, _identify, _rate, _tables, _toml, statistics


def everything():
    for module in (stickslip, _toml, statistics, _rate, _dual, _campaign, _folder, _identify, _tables):
        yield module.__name__, module
    for name in stickslip.__all__:
        value = getattr(stickslip, name)
        if name != "__version__":
            yield name, value
        if inspect.isclass(value):
            for key, member in vars(value).items():
                if not key.startswith("_"):
                    yield f"{name}.{key}", getattr(member, "__func__", member)
    for name in ("exceedance", "first_order", "sobol"):
        yield f"statistics.{name}", getattr(statistics, name)


@pytest.mark.parametrize("name, value", list(everything()), ids=lambda one: one if isinstance(one, str) else "")
def test_documentation_is_there_and_its_examples_run(name, value):
    text = inspect.getdoc(value)
    if isinstance(value, (property, type(_core.Study.run))) or callable(value):
        assert text, f"{name} has no documentation"
    test = doctest.DocTestParser().get_doctest(text or "", {}, name, None, None)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    report = []
    runner.run(test, out=report.append)
    assert runner.failures == 0, "".join(report)


def test_the_stubs_name_what_is_there():
    tree = ast.parse((Path(_core.__file__).parent / "_core.pyi").read_text())
    stated = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    there = {name for name, value in vars(_core).items() if callable(value)}
    assert set(stated) == there
    for name, node in stated.items():
        if isinstance(node, ast.ClassDef):
            members = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
            public = {key for key in vars(getattr(_core, name)) if not key.startswith("_")}
            assert {key for key in members if not key.startswith("_")} == public, name
        else:
            keywords = {argument.arg for argument in node.args.args + node.args.kwonlyargs + node.args.posonlyargs}
            assert keywords - {"parameters"} == {key for key in inspect.signature(getattr(_core, name)).parameters} - {"parameters"}, name


def test_the_package_holds_the_strictest_types(tmp_path):
    api = pytest.importorskip("mypy.api")
    # a copy, because mypy does not check installed packages of its environment
    package = shutil.copytree(Path(stickslip.__file__).parent, tmp_path / "stickslip", ignore=shutil.ignore_patterns("*.so", "*.pyd"))
    out, errors, status = api.run(["--strict", "--no-incremental", str(package)])
    assert status == 0, out + errors


def test_the_stubs_are_those_of_the_built_package(tmp_path):
    pytest.importorskip("mypy")
    found = subprocess.run([sys.executable, "-m", "mypy.stubtest", "stickslip"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout + found.stderr


def test_the_types_hold(tmp_path):
    api = pytest.importorskip("mypy.api")
    use = tmp_path / "use.py"
    use.write_text(
        "import stickslip; import numpy as np\n"
        "model = stickslip.Model()\n"
        "model.mass('a', '1 kg')\n"
        "orbit = model.orbit('10 Hz', method='event-driven')\n"
        "amplitude: float = orbit.amplitude['a']\n"
        "wrong: str = orbit.amplitude['a']\n"
        "model.mass('b')\n"
        "from collections.abc import Mapping\n"
        "table: Mapping[str, object] = model.response(np.array([10, 11]), vary={'a.mass': [np.float32(1.0), '2 kg']})['curve']\n"
    )
    # a copy, because mypy does not check installed packages of its environment
    package = shutil.copytree(Path(stickslip.__file__).parent, tmp_path / "stickslip", ignore=shutil.ignore_patterns("*.so", "*.pyd"))
    out, errors, _ = api.run([str(use), str(package), "--cache-dir", str(tmp_path / "cache"), "--ignore-missing-imports"])
    # two errors in the script, and no error in the package
    assert "use.py:6" in out and "use.py:7" in out and "Found 2 errors" in out, out + errors
