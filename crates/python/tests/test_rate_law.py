"""Laws written in Python: the built-in ones again, with derivatives that differences have."""

import numpy as np
import pytest
from conftest import couple

import stickslip
from stickslip._dual import Dual

K, LIMIT = 1e4, 2.0


@stickslip.rate_law(states=1, scale=LIMIT, odd=True)
def dahl(u, v, z):
    """f' = K v (1 - f / LIMIT sgn v), the state is f / LIMIT."""
    return LIMIT * z[0], (K / LIMIT * (v - abs(v) * z[0]))[None]


@stickslip.rate_law(odd=True)
def cubic(u, v, z):
    return 1e9 * u**3


@pytest.mark.parametrize("method", [{"method": "harmonic-balance", "harmonics": 9}, {"method": "shooting"}])
@pytest.mark.parametrize(
    "mine, builtin",
    [(dahl, ("dahl", {"stiffness": K, "limit": LIMIT})), (cubic, ("cubic", {"stiffness": 1e9}))],
    ids=["dahl", "cubic"],
)
def test_a_law_in_python_gives_the_orbit_of_the_builtin_law(method, mine, builtin):
    name, parameters = builtin
    own = couple(mine).orbit(118.0, **method)
    rust = couple(stickslip.law(name, **parameters)).orbit(118.0, **method)
    for place in ("blade1", "blade3"):
        assert own.first_harmonic[place] == pytest.approx(rust.first_harmonic[place], rel=1e-10)
        assert own.amplitude[place] == pytest.approx(rust.amplitude[place], rel=1e-10)
    assert own.dissipation["shroud"] == pytest.approx(rust.dissipation["shroud"], rel=1e-9, abs=1e-12)
    assert own.stable == rust.stable


def test_many_orbits_of_a_law_in_python_run_on_all_threads():
    own = couple(dahl).response([117.0, 118.0, 119.0], method="harmonic-balance", harmonics=5, threads=2)
    rust = couple(stickslip.law("dahl", stiffness=K, limit=LIMIT))
    rust = rust.response([117.0, 118.0, 119.0], method="harmonic-balance", harmonics=5)
    np.testing.assert_allclose(own["curve"]["blade1_amplitude_m"], rust["curve"]["blade1_amplitude_m"], rtol=1e-9)


def test_a_law_gets_whole_arrays_of_instants():
    sizes = []

    @stickslip.rate_law(states=1, scale=LIMIT, odd=True)
    def counted(u, v, z):
        sizes.append(len(v))
        return LIMIT * z[0], K / LIMIT * (v - abs(v) * z)

    couple(counted).orbit(118.0, method="harmonic-balance", harmonics=9)
    # single instants remain in the checks of the law (241), in the way from static equilibrium to the first sample
    # (320 for each of a few evaluations), and in one period by integration
    assert sum(size >= 256 for size in sizes) > 20 and len(sizes) < 2000
    # without states, a call has all instants of a period
    sizes.clear()
    couple(stickslip.rate_law(lambda u, v, z: sizes.append(len(u)) or 1e9 * u**3, odd=True)).orbit(118.0, method="harmonic-balance")
    assert max(sizes) >= 1024 and len(sizes) < 1000


def test_own_derivatives_do_as_well():
    def slopes(u, v, z):
        by = np.zeros((2, 3, u.size))
        by[0, 2] = LIMIT
        by[1, 1] = K / LIMIT * (1 - np.sign(v) * z[0])
        by[1, 2] = -K / LIMIT * abs(v)
        return by

    def law(u, v, z):
        return LIMIT * z[0], (K / LIMIT * (v - abs(v) * z[0]))[None]

    mine = stickslip.rate_law(law, states=1, scale=LIMIT, odd=True, derivatives=slopes)
    one, other = (couple(each).orbit(118.0, method="harmonic-balance", harmonics=5) for each in (mine, dahl))
    assert one.amplitude["blade1"] == pytest.approx(other.amplitude["blade1"], rel=1e-12)


def test_a_law_may_act_along_two_directions():
    @stickslip.rate_law(directions=2)
    def dampers(u, v, z):
        return np.stack([3.0 * v[0], 3.0 * v[1]])

    model = stickslip.Model()
    model.mass("m", 1.0, directions=["x", "y"])
    for place in ("m.x", "m.y"):
        model.spring(place, "ground", stiffness=1e4)
        model.force(place, 1.0)
    model.joint("d", "m", "ground", dampers)
    orbit = model.orbit(10.0, method="harmonic-balance")
    omega = 20 * np.pi
    assert abs(orbit.first_harmonic["m.y"]) == pytest.approx(1 / abs(1e4 - omega**2 + 3j * omega), rel=1e-9)


TWO = {
    "stack": lambda u, v: np.stack([3.0 * v[0], 3.0 * v[1]]),
    "whole": lambda u, v: 3.0 * v,
    "list": lambda u, v: [3.0 * v[0], 3.0 * v[1]],
    "tuple rows": lambda u, v: np.vstack([3.0 * v[0], 3.0 * v[1]]),
    "matrix": lambda u, v: np.array([[3.0, 0.0], [0.0, 3.0]]) @ v,
    "in place": lambda u, v: _filled(v),
    "einsum": lambda u, v: np.einsum("ij,jn->in", 3.0 * np.eye(2), v),
}


def _filled(v):
    out = np.zeros_like(v)
    out[0] = 3.0 * v[0]
    out[1:] += 3.0 * v[1:]
    return out


@pytest.mark.parametrize("form", TWO)
def test_a_law_of_two_directions_may_use_every_form_of_array(form):
    law = stickslip.rate_law(lambda u, v, z: TWO[form](u, v), directions=2)
    assert law.check_derivatives() < 1e-6
    model = stickslip.Model()
    model.mass("m", 1.0, directions=["x", "y"])
    for place in ("m.x", "m.y"):
        model.spring(place, "ground", stiffness=1e4)
        model.force(place, 1.0)
    model.joint("d", "m", "ground", law)
    omega = 20 * np.pi
    found = model.orbit(10.0, method="harmonic-balance").first_harmonic
    for place in ("m.x", "m.y"):
        assert abs(found[place]) == pytest.approx(1 / abs(1e4 - omega**2 + 3j * omega), rel=1e-9)


ONE = {
    "rows": lambda u, v, z, rate: (LIMIT * z[0], rate[None]),
    "list": lambda u, v, z, rate: (LIMIT * z[0], [rate]),
    "plain": lambda u, v, z, rate: (LIMIT * z[0], rate),
    "row of force": lambda u, v, z, rate: ((LIMIT * z)[:1], rate.reshape(1, -1)),
    "whole states": lambda u, v, z, rate: (LIMIT * z[0], K / LIMIT * (v - abs(v) * z)),
}


@pytest.mark.parametrize("form", ONE)
def test_a_law_with_a_state_may_return_every_form_of_array(form):
    law = stickslip.rate_law(lambda u, v, z: ONE[form](u, v, z, K / LIMIT * (v - abs(v) * z[0])), states=1, scale=LIMIT)
    assert law.check_derivatives() < 1e-6
    one, other = (couple(each).orbit(118.0, method="harmonic-balance", harmonics=3) for each in (law, dahl))
    assert one.amplitude["blade1"] == pytest.approx(other.amplitude["blade1"], rel=1e-12)


@stickslip.rate_law(states=1, parameters={"stiffness": "10 N/mm", "limit": LIMIT}, scale="limit", odd=True)
def with_parameters(u, v, z, stiffness, limit):
    return limit * z[0], stiffness / limit * (v - abs(v) * z)


def test_parameters_of_a_law_are_set_and_varied():
    assert with_parameters.parameters == {"stiffness": K, "limit": LIMIT}
    options = {"method": "harmonic-balance", "harmonics": 5}
    model = couple(with_parameters)
    model.set({"shroud.stiffness": "12 N/mm", "shroud.limit": "3 N"})
    rust = couple(stickslip.law("dahl", stiffness=12e3, limit=3.0)).orbit(118.0, **options)
    assert model.orbit(118.0, **options).amplitude["blade1"] == pytest.approx(rust.amplitude["blade1"], rel=1e-9)
    limits = [1.5, 2.0, 2.5]
    own = couple(with_parameters).response(118.0, vary={"shroud.limit": limits}, **options)["curve"]
    rust = couple(stickslip.law("dahl", stiffness=K, limit=2.0)).response(118.0, vary={"shroud.limit": limits}, **options)["curve"]
    np.testing.assert_allclose(own["blade1_amplitude_m"], rust["blade1_amplitude_m"], rtol=1e-9)
    assert own["shroud_limit"].tolist() == limits
    # the original law is unchanged
    assert with_parameters.parameters["limit"] == LIMIT
    for values, words in [
        ({"shroud.limit": 0.0}, "scale"),
        ({"shroud.stiffness": "3 N"}, "stiffness"),
        ({"shroud.friction": 3.0}, "no parameter"),
    ]:
        with pytest.raises(stickslip.ModelError, match=words):
            model.set(values)
    with pytest.raises(stickslip.ModelError, match="name of a parameter"):
        stickslip.rate_law(lambda u, v, z, a: u, parameters={"a": 1.0}, scale="b")


def test_wrong_derivatives_are_found_by_one_call():
    def law(u, v, z):
        return LIMIT * z[0], (K / LIMIT * (v - abs(v) * z[0]))[None]

    def slopes(u, v, z, wrong=1.0):
        by = np.zeros((2, 3, u.size))
        by[0, 2] = LIMIT
        by[1, 1] = wrong * K / LIMIT * (1 - np.sign(v) * z[0])
        by[1, 2] = -K / LIMIT * abs(v)
        return by

    assert stickslip.rate_law(law, states=1, derivatives=slopes).check_derivatives() < 1e-8
    wrong = stickslip.rate_law(law, states=1, derivatives=lambda u, v, z: slopes(u, v, z, 1.01))
    with pytest.raises(ValueError, match="rate 0 by v is .*the difference quotient is"):
        wrong.check_derivatives()
    with pytest.raises(ValueError, match="rate 0 by v"):
        wrong.check_derivatives(u=[0.0], v=[1.0], z=[[0.5]])
    # points at rest have derivatives too
    assert dahl.check_derivatives(u=0.0, v=[1.0, 2.0], z=[[0.5, 0.0]]) < 1e-8
    with pytest.raises(ValueError, match=r"`v` must have the shape \(1, 3\) or \(3,\), found \(2,\)"):
        dahl.check_derivatives(u=[0.0, 1e-3, 2e-3], v=[1.0, 2.0])
    with pytest.raises(TypeError, match="built-in"):
        stickslip.law("dahl", stiffness=K, limit=LIMIT).check_derivatives()


def test_what_a_law_raises_is_raised():
    @stickslip.rate_law(states=1)
    def wrong(u, v, z):
        raise ZeroDivisionError("in the law")

    for method in ("harmonic-balance", "shooting"):
        with pytest.raises(ZeroDivisionError, match="in the law"):
            couple(wrong).orbit(118.0, method=method)

    @stickslip.rate_law(states=1)
    def unknown(u, v, z):
        return np.sinc(z[0]), v[None]

    with pytest.raises(TypeError, match="derivatives"):
        couple(unknown).orbit(118.0, method="harmonic-balance")

    @stickslip.rate_law
    def infinite(u, v, z):
        return u / 0.0 * 0.0

    with np.errstate(all="ignore"), pytest.raises(stickslip.OrbitError):
        couple(infinite).orbit(118.0, method="harmonic-balance")
    with pytest.raises(stickslip.ModelError, match="1 to 3"):
        stickslip.rate_law(lambda u, v, z: u, directions=4)


FUNCTIONS = [
    lambda a, b: a * b + a / b - 3 / a,
    lambda a, b: np.exp(a) * np.tanh(b) - np.log(b) + 2.0**a,
    lambda a, b: np.sqrt(b) + np.arctan(a) * np.sign(a) * abs(a) ** 1.7,
    lambda a, b: np.where(a > 0.2, a * a, b) + np.maximum(a, b) + np.clip(a, -0.1, 0.1),
    lambda a, b: np.hypot(a, b) + np.arctan2(a, b) + np.cbrt(b) + np.square(a) + np.log1p(b),
    lambda a, b: np.sin(a) * np.cos(b) + np.tan(a) + np.sinh(a) * np.cosh(b) + np.expm1(b) + a**3 + b ** (-1),
    lambda a, b: np.copysign(a, b) + np.arcsinh(b) + np.arcsin(0.5 * a) + np.arccos(0.5 * a) + np.minimum(a, 0.3),
]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_dual_arrays_have_the_derivatives_that_differences_have(function):
    a, b = np.array([-0.7, 0.05, 0.4, 0.9]), np.array([0.3, 0.8, 1.1, 0.6])
    ones, zeros = np.ones_like(a), np.zeros_like(a)
    dual = function(Dual(a, np.stack([ones, zeros])), Dual(b, np.stack([zeros, ones])))  # rows: derivatives with respect to a and b
    step = 1e-6
    by_a = (function(a + step, b) - function(a - step, b)) / (2 * step)
    by_b = (function(a, b + step) - function(a, b - step)) / (2 * step)
    np.testing.assert_allclose(dual.value, function(a, b), rtol=1e-14)
    np.testing.assert_allclose(dual.slope, [by_a, by_b], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize(
    "function, options, words",
    [
        (lambda u, v, z: None, {}, "returned None"),
        (lambda u, v, z: (u, v), {}, "states=0"),
        (lambda u, v, z: u, {"states": 1}, "for its 1 states"),
        (lambda u, v, z: (z[0], v[None]), {"states": 2}, "1 rates for its 2 states"),
    ],
)
def test_wrong_answers_are_named(function, options, words):
    law = stickslip.rate_law(function, name="mine", **options)
    with pytest.raises((TypeError, ValueError), match=words):
        couple(law).orbit(121.0, method="shooting")


def test_what_is_not_odd_may_not_say_so():
    with pytest.raises(ValueError, match="not odd"):
        stickslip.rate_law(lambda u, v, z: 1e3 * np.maximum(u, 0.0), odd=True)
    with pytest.raises(TypeError, match="a function of u, v, z"):
        stickslip.rate_law(3)
