"""Fits of parameters to measured data: against the command, SciPy and closed forms."""

import csv
import pickle

import numpy as np
import pytest

import stickslip

#: A loop of a slider (50 N/mm, 2 N) with noise.
TIME = np.linspace(0.0, 2 * np.pi, 161)
DISPLACEMENT = 1e-4 * np.concatenate([np.sin(TIME), np.sin(TIME)[1:]])


def jenkins(displacement, stiffness, limit):
    force, slider = [], 0.0
    for u in displacement:
        slider = min(max(slider, u - limit / stiffness), u + limit / stiffness)
        force.append(stiffness * (u - slider))
    return np.array(force)


FORCE = jenkins(DISPLACEMENT, 5e4, 2.0) + 0.02 * np.random.default_rng(3).standard_normal(DISPLACEMENT.size)
COLUMNS = {"rig.csv": {"displacement_m": DISPLACEMENT, "force_N": FORCE}}
STUDY = """schema = 1
data = [{ name = "rig", file = "rig.csv" }]
parameters = { kt = "20 N/mm", Ft = "1 N" }
mass = [{ name = "m", mass = "1 kg" }]
joint = [{ name = "pad", between = ["m", "ground"], law = { kind = "jenkins", stiffness = "kt", limit = "Ft" } }]
[study]
kind = "identify"
fit.kt = { from = "1 N/mm", to = "1000 N/mm", scale = "log" }
fit.Ft = { from = "0.1 N", to = "20 N" }
targets = [{ data = "rig", is = "loop", at = "pad", weight = "0.02 N" }]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the study and its data."""
    folder = tmp_path_factory.mktemp("identify")
    (folder / "rig.toml").write_text(STUDY)
    with open(folder / "rig.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS["rig.csv"])
        writer.writerows(zip(*(column.tolist() for column in COLUMNS["rig.csv"].values())))
    return folder


@pytest.fixture(scope="module")
def found(folder):
    return stickslip.identify(folder / "rig.toml", COLUMNS)


def test_parameters_of_a_loop_are_found(found):
    error = np.sqrt(np.diag(found.cov))
    truth = dict(kt=5e4, Ft=2.0)
    assert sorted(found.names) == ["Ft", "kt"] and found.status == ["determined"] * 2
    for name, x, sigma in zip(found.names, found.x, error):
        assert abs(x - truth[name]) < 4 * sigma < 0.05 * truth[name]
    # the residuals are those of the law, divided by the weight
    law = jenkins(DISPLACEMENT, *(dict(zip(found.names, found.x))[name] for name in ("kt", "Ft")))
    np.testing.assert_allclose(found.fun, (law - FORCE) / 0.02, rtol=1e-9, atol=1e-9)
    assert found.variance == pytest.approx(1.0, abs=0.2)


def test_values_and_errors_are_those_of_the_command(command, found, folder):
    command("run", folder / "rig.toml", "--out", folder / "out", "--only", "csv")
    with open(folder / "out" / "rig" / "parameters.csv") as file:
        rows = {row["parameter"]: row for row in csv.DictReader(file)}
    for name, x, variance in zip(found.names, found.x, np.diag(found.cov)):
        assert float(rows[name]["value"]) == pytest.approx(x, rel=1e-9)
        assert float(rows[name]["standard_error"]) == pytest.approx(np.sqrt(variance), rel=1e-9)
    # arrays, files and dictionaries give the same fit
    for study in (stickslip.Study.from_file(folder / "rig.toml"), str(folder / "rig.toml")):
        np.testing.assert_array_equal(stickslip.identify(study).x, found.x)
    with pytest.raises(stickslip.StudyError, match="rig.csv"):
        stickslip.identify(stickslip.Study.from_text(STUDY))


def test_scipy_finds_the_same_minimum(found):
    least_squares = pytest.importorskip("scipy.optimize").least_squares
    residuals = found.residuals
    scipy = least_squares(residuals.values, residuals.start, residuals.jacobian, bounds=residuals.bounds, x_scale="jac", xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(found.x, scipy.x, rtol=1e-4)
    covariance = np.linalg.inv(scipy.jac.T @ scipy.jac) * found.variance
    np.testing.assert_allclose(found.cov, covariance, rtol=0.02)


def test_the_likelihood_has_its_gradient(found):
    x = found.x * [1.02, 0.97]
    step = 1e-4 * found.x
    shifted = [x + sign * part for part in np.diag(step) for sign in (1, -1)]
    values = found.log_likelihood(shifted)
    differences = (values[::2] - values[1::2]) / (2 * step)
    np.testing.assert_allclose(found.gradient(x), differences, rtol=1e-3)
    assert found.log_likelihood(found.x) > found.log_likelihood(x)
    assert found.log_likelihood(-found.x) == -np.inf


def test_a_fit_is_pickled_with_its_data(found, folder):
    again = pickle.loads(pickle.dumps(found))
    x = found.x * [1.02, 0.97]
    assert again.names == found.names and again.log_likelihood(x) == found.log_likelihood(x)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(again.residuals)).jacobian(x), found.residuals.jacobian(x))
    # without columns, the rows come from the files of the study
    residuals = stickslip.Residuals(stickslip.Study.from_file(folder / "rig.toml"))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(residuals)).values(x), residuals.values(x))


def test_columns_replace_only_their_files(found, folder, tmp_path):
    """The other files of the study stay where they are, beside the study file."""
    both = STUDY.replace("data = [", 'data = [{ name = "other", file = "rig.csv" }, ').replace(
        'name = "rig", file = "rig.csv"', 'name = "rig", file = "given.csv"'
    )
    (folder / "both.toml").write_text(both)
    again = stickslip.identify(folder / "both.toml", {"given.csv": COLUMNS["rig.csv"]})
    np.testing.assert_array_equal(again.x, found.x)
    # without the file, and for a study that was read from it
    (tmp_path / "rig.toml").write_text(STUDY)
    with pytest.raises(stickslip.StudyError, match="columns are given for `test.csv`, not for `rig.csv`"):
        stickslip.identify(tmp_path / "rig.toml", {"test.csv": COLUMNS["rig.csv"]})
    study = stickslip.Study.from_file(folder / "rig.toml")
    with pytest.raises(stickslip.StudyError, match="columns are given for `test.csv`, but no"):
        stickslip.identify(study, COLUMNS | {"test.csv": COLUMNS["rig.csv"]})
    with pytest.raises(ValueError, match="column `force_N` of `rig.csv` is complex"):
        stickslip.identify(study, {"rig.csv": COLUMNS["rig.csv"] | {"force_N": FORCE + 0j}})


def test_wrong_fits_are_refused_with_words(found, folder):
    with pytest.raises(stickslip.StudyError, match="kind `identify`"):
        stickslip.identify(stickslip.Study.from_template("element"))
    with pytest.raises(ValueError, match="equally long"):
        stickslip.identify(folder / "rig.toml", {"rig.csv": {"displacement_m": [0, 1], "force_N": [0]}})
    for wrong, words in (([1.0], "found 1 parameters, expected 2"), ([-1.0, 1.0], "outside of its range"), ("12", "`x` must be")):
        with pytest.raises(stickslip.ModelError, match=words):
            found.residuals.values(wrong)
    with pytest.raises(stickslip.ModelError, match="expected 2"):
        found.log_likelihood([1.0])
