"""An error in a law and Ctrl-C end every call within a second, and what was interrupted can be used again."""

import _thread
import signal
import threading
import time

import numpy as np
import pytest
from conftest import couple

import stickslip


@pytest.fixture
def ctrl_c():
    """Presses Ctrl-C after a while; a shell lets what it runs in the background ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timers = []

    def press(seconds):
        timers.append(threading.Timer(seconds, _thread.interrupt_main))
        timers[-1].start()
        return time.monotonic() + seconds

    yield press
    for timer in timers:
        timer.cancel()
    signal.signal(signal.SIGINT, before)


def cubic_couple(law):
    """The couple of a law that takes its time, by whole periods."""
    model = stickslip.Model()
    for blade in "ab":
        model.mass(blade, 0.182)
        model.spring(blade, "ground", stiffness=105_103, damping=2)
    model.joint("j", "a", "b", law)
    model.force("a", 10)
    return model


CALLS = {
    "orbit": lambda model: model.orbit(118, method="harmonic-balance", harmonics=15, samples=512),
    "shooting": lambda model: model.orbit(118, method="shooting"),
    "transient": lambda model: model.orbit(118, method="transient"),
    "response": lambda model: model.response(np.linspace(110, 125, 40), method="harmonic-balance", harmonics=15, samples=512, threads=2),
    "vary": lambda model: model.response(118, vary={"a.force": np.linspace(1, 10, 40)}, method="harmonic-balance", threads=2),
    "modes": lambda model: model.modes((1e-5, 1e-3), harmonics=7, samples=128),
    "hysteresis": lambda model: model.hysteresis(118, method="harmonic-balance"),
}


@pytest.mark.parametrize("call", CALLS)
def test_what_a_law_raises_ends_the_call_with_no_further_calls(call):
    calls, fails = 0, 5

    def law(u, v, z):
        nonlocal calls
        calls += 1
        if calls >= fails:
            raise ValueError("mine")
        return 1e8 * u**3

    model = cubic_couple(stickslip.rate_law(law))
    begun = time.monotonic()
    with pytest.raises(ValueError, match="mine"):
        CALLS[call](model)
    assert time.monotonic() - begun < 1.0
    # other threads inside the law at that time may have raised too
    assert fails <= calls <= fails + 2
    # the model still works
    fails = 10**9
    assert model.orbit(118, method="harmonic-balance").amplitude["a"] > 0


def test_an_orbit_that_never_ends_is_ended_by_ctrl_c(ctrl_c):
    def law(u, v, z):
        time.sleep(0.01)
        return 1e8 * u**3

    model = cubic_couple(stickslip.rate_law(law))
    for call in ("shooting", "transient", "modes", "response"):
        pressed = ctrl_c(0.5)
        with pytest.raises(KeyboardInterrupt):
            for _ in range(1000):
                CALLS[call](model)
        assert time.monotonic() - pressed < 1.0, call


def test_ctrl_c_ends_calls_on_large_dense_matrices(ctrl_c):
    n = 1500  # one factorization takes about a second
    random = np.random.default_rng(1).standard_normal((n, n))
    model = stickslip.Model.from_matrices(np.eye(n), random @ random.T + n * np.eye(n), places=[f"p{i}" for i in range(n)])
    model.joint("j", "p0", "p1", stickslip.law("dahl", stiffness=100.0, limit=1.0))
    model.force("p0", 1.0)
    for call in (
        lambda: model.orbit(5.0, method="harmonic-balance"),
        lambda: model.check(),
        lambda: model.response(np.linspace(1.0, 10.0, 50), threads=2),
    ):
        pressed = ctrl_c(0.5)
        with pytest.raises(KeyboardInterrupt):
            while True:
                call()
        assert time.monotonic() - pressed < 1.0


def test_an_interrupted_model_gives_the_same_bits_afterwards(ctrl_c):
    model, fresh = couple(stickslip.law("dahl", stiffness=1e4, limit=2.0)), couple(stickslip.law("dahl", stiffness=1e4, limit=2.0))
    ctrl_c(0.3)
    with pytest.raises(KeyboardInterrupt):
        while True:
            model.orbit(118, method="shooting")
    assert (model.orbit(118, method="shooting").start == fresh.orbit(118, method="shooting").start).all()
