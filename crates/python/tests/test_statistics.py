"""Statistics of samples: against closed forms, whatever the mean, and with values that are missing."""

import numpy as np
import pytest

import stickslip
from stickslip.statistics import exceedance, first_order, sobol


@pytest.mark.parametrize("mean", [0.0, 121.0, 1e4, 1e8])
def test_indices_do_not_depend_on_the_mean(mean):
    pytest.importorskip("scipy")
    # f = c (x + 2 y) of uniform x, y: the variances have the ratio 1:4
    found = sobol(lambda p: mean + 0.02 * (p[:, 0] + 2 * p[:, 1]), [(0, 1), (0, 1)])
    np.testing.assert_allclose(found["first"], [0.2, 0.8], atol=1e-3)
    np.testing.assert_allclose(found["total"], [0.2, 0.8], atol=1e-3)


def test_values_that_are_missing_are_left_out_and_counted():
    pytest.importorskip("scipy")

    def lossy(p):
        values = 121.0 + 0.02 * (p[:, 0] + 2 * p[:, 1])
        values[::50] = np.nan
        return values

    with pytest.warns(UserWarning, match="82 of 4096 values"):
        found = sobol(lossy, [(0, 1), (0, 1)])
    np.testing.assert_allclose(found["first"], [0.2, 0.8], atol=0.02)
    with pytest.warns(UserWarning, match="3072 of 3072"):
        assert np.isnan(sobol(lambda p: np.full(len(p), np.nan), [(0, 1)])["first"]).all()
    # a constant function has the index zero
    assert sobol(lambda p: np.ones(len(p)), [(0, 1)])["first"].tolist() == [0.0]
    with pytest.raises(ValueError, match="must return 3072 values"):
        sobol(lambda p: 1.0, [(0, 1)])


def test_a_share_of_nothing_is_no_number():
    assert np.isnan(exceedance([np.nan, np.nan], [1.0])).all() and np.isnan(exceedance([], 1.0))
    assert exceedance([np.nan, 2.0], [1.0, 3.0]).tolist() == [1.0, 0.0]
    assert np.isnan(first_order([np.nan, 1.0], [1.0, np.nan]))


def test_an_index_of_a_sample_leaves_out_what_is_missing():
    x = np.random.default_rng(4).uniform(0, 1, (20_000, 2))
    y = 1e4 + x[:, 0] + 2 * x[:, 1]
    y[::7] = np.nan
    assert first_order(x[:, 1], y) == pytest.approx(0.8, abs=0.03)
    assert stickslip.statistics.first_order(list(x[:, 0]), list(y)) == pytest.approx(0.2, abs=0.03)


def test_sobol_indices_are_those_of_ishigami():
    pytest.importorskip("scipy")
    # Ishigami and Homma (1990), a = 7, b = 0.1: closed forms
    a, b = 7.0, 0.1
    first = np.array([0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0])
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = first + np.array([both, 0.0, both])
    variance = first.sum() + both

    def ishigami(x):
        return np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])

    found = stickslip.statistics.sobol(ishigami, [(-np.pi, np.pi)] * 3, count=8192, seed=3)
    np.testing.assert_allclose(found["first"], first / variance, atol=0.02)
    np.testing.assert_allclose(found["total"], total / variance, atol=0.02)
    x = np.random.default_rng(2).uniform(-np.pi, np.pi, (20_000, 3))
    given = [stickslip.statistics.first_order(x[:, i], ishigami(x)) for i in range(3)]
    np.testing.assert_allclose(given, first / variance, atol=0.03)
