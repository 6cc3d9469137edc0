"""Models by calls: against closed forms, SciPy, and the methods against each other."""

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from conftest import CONTACT, DAMPING, FORCE, LIMIT, MASS, STIFFNESS, couple

import stickslip


def test_a_linear_oscillator_has_its_receptance():
    model = stickslip.Model()
    model.mass("m", "200 g")
    model.spring("m", "ground", stiffness="50 N/mm", damping="2 kg/s")
    model.force("m", "3 N", phase="30 deg")
    frequency = np.linspace(20, 120, 41)
    omega = 2 * np.pi * frequency
    expected = 3 * np.exp(1j * np.pi / 6) / (50e3 - 0.2 * omega**2 + 2j * omega)
    table = model.response(frequency)["curve"]
    np.testing.assert_allclose(table["m_amplitude_m"], abs(expected), rtol=1e-9)
    np.testing.assert_allclose(table["m_phase_deg"], np.degrees(np.angle(expected)), atol=1e-6)
    np.testing.assert_array_equal(table["frequency_Hz"], frequency)
    orbit = model.orbit("60 Hz")
    expected = 3 * np.exp(1j * np.pi / 6) / (50e3 - 0.2 * (120 * np.pi) ** 2 + 240j * np.pi)
    assert orbit.first_harmonic["m"] == pytest.approx(expected, rel=1e-9)
    assert orbit.energy["viscous"] == pytest.approx(np.pi * 2 * 120 * np.pi * abs(expected) ** 2, rel=1e-9)
    motion = orbit.sample(points=64)
    assert motion["displacement_m"].shape == (64, 1)
    np.testing.assert_allclose(
        motion["displacement_m"][:, 0], (expected * np.exp(2j * np.pi * 60 * motion["time_s"])).real, atol=1e-12
    )


def test_an_orbit_of_the_couple_is_what_scipy_integrates():
    integrate = pytest.importorskip("scipy.integrate")
    frequency, period = 121.0, 1 / 121.0
    orbit = couple().orbit(frequency)
    joint = orbit.hysteresis("shroud")
    assert abs(joint["force_N"]).max() == pytest.approx(LIMIT, rel=1e-12)
    # integrate one period from the orbit's start, with the slider force as an exact clamp
    start = orbit.start
    offset = start[0] - start[1] - joint["force_N"][0] / CONTACT

    def steps(count):
        t = np.linspace(0, period, count + 1)
        dt, s = t[1], offset
        x, v = start[:2].copy(), start[2:4].copy()

        def acceleration(time, x, v, s):
            f = np.clip(CONTACT * (x[0] - x[1] - s), -LIMIT, LIMIT)
            drive = FORCE * np.cos(2 * np.pi * frequency * time)
            return (np.array([drive - f, f]) - STIFFNESS * x - DAMPING * v) / MASS

        for time in t[:-1]:
            a = acceleration(time, x, v, s)
            half = v + 0.5 * dt * a
            x = x + dt * half
            u = x[0] - x[1]
            s = np.clip(s, u - LIMIT / CONTACT, u + LIMIT / CONTACT)
            v = half + 0.5 * dt * acceleration(time + dt, x, half + 0.5 * dt * a, s)
        return np.concatenate([x, v])

    del integrate
    errors = [np.linalg.norm(steps(n)[:2] - start[:2]) / np.linalg.norm(start[:2]) for n in (2000, 4000)]
    assert errors[1] < 1e-4 and errors[1] < 0.6 * errors[0]


def test_methods_agree_and_give_their_evidence():
    model = couple()
    exact = model.orbit("121 Hz", method="event-driven")
    series = model.orbit("121 Hz", method="harmonic-balance", harmonics=31)
    assert series.amplitude["blade1"] == pytest.approx(exact.amplitude["blade1"], rel=1e-4)
    assert exact.evidence["residual"] < 1e-10 and exact.evidence["energy_gap"] < 1e-9
    assert series.evidence["truncation"] < 1e-3 and series.method == "harmonic-balance"
    assert exact.stable and abs(exact.multipliers).max() <= 1 + 1e-6
    # the dissipation is the area of the loop
    loop = exact.hysteresis(points=20_000)
    u, f = (np.append(loop[key], loop[key][0]) for key in ("displacement_m", "force_N"))
    assert 0.5 * np.sum((f[1:] + f[:-1]) * np.diff(u)) == pytest.approx(exact.dissipation["shroud"], rel=1e-6)
    again = model.hysteresis("121 Hz", method="event-driven")
    assert again["loops_summary"]["dissipation_J"][0] == exact.dissipation["shroud"]


def test_an_orbit_has_the_same_bits_whatever_was_computed_before():
    fresh, used = couple(), couple()
    for frequency in (118.0, 121.0, 124.0, 121.5):
        used.orbit(frequency)
    assert (used.orbit(120.0).start == fresh.orbit(120.0).start).all()


def test_places_with_directions_are_drawn():
    model = stickslip.Model()
    model.mass("body", 1.0, directions=["x", "z"])
    for place, stiffness in (("body.x", 1e4), ("body.z", 4e4)):
        model.spring(place, "ground", stiffness=stiffness, damping=2.0)
        model.force(place, 1.0)
    response = model.response([14.0, 15.0, 16.0])
    drawn = {series["label"]: series["y"] for series in response.figure["panels"][0]["series"]}
    assert drawn == {place: list(response["curve"][f"{place.replace('.', '_')}_amplitude_m"]) for place in ("body.x", "body.z")}


def test_one_call_for_many_parameters_is_many_calls():
    limits = np.linspace(0.5, 4.0, 130)
    together = couple().response("121 Hz", vary={"shroud.limit": limits})["curve"]
    np.testing.assert_array_equal(together["shroud_limit"], limits)
    for index in (0, 61, 129):
        alone = couple(stickslip.law("jenkins", stiffness=CONTACT, limit=limits[index])).orbit("121 Hz")
        assert together["blade1_amplitude_m"][index] == alone.amplitude["blade1"]
        assert together["shroud_dissipation_J"][index] == alone.dissipation["shroud"]
    # every kind of parameter, and a frequency for each point
    mixed = couple().response(
        [120.0, 121.0],
        vary={"blade1.mass": ["181 g", 0.182], "blade3-ground.stiffness": 1e5, "blade1.force": [9.0, 10.0], "blade1-ground.damping": 0.3},
        threads=1,
    )["curve"]
    model = couple()
    model.set({"blade1.mass": 0.182, "blade3-ground.stiffness": "100 N/mm", "blade1.force": 10, "blade1-ground.damping": 0.3})
    assert mixed["blade1_amplitude_m"][1] == model.orbit(121).amplitude["blade1"]
    threads = [couple().response("121 Hz", vary={"shroud.limit": limits}, threads=n)["curve"] for n in (1, 3)]
    np.testing.assert_array_equal(threads[0]["blade1_amplitude_m"], threads[1]["blade1_amplitude_m"])


def test_matrices_are_the_model_that_was_stated_by_masses():
    sparse = pytest.importorskip("scipy.sparse")
    linalg = pytest.importorskip("scipy.linalg")
    n = 60
    rng = np.random.default_rng(5)
    stiffness = sparse.diags([2.1 + rng.random(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1], format="csr") * 1e4
    mass = np.diag(0.1 + rng.random(n))
    mass[3, 4] = mass[4, 3] = 0.02  # a coupling that point masses cannot describe
    damping = 1e-5 * stiffness
    places = [f"p{i}" for i in range(n)]
    model = stickslip.Model.from_matrices(sparse.coo_matrix(mass), stiffness, damping.toarray(), places=places)
    np.testing.assert_allclose(model.matrices["stiffness"], stiffness.toarray())
    np.testing.assert_allclose(model.matrices["mass"], mass)
    model.force("p7", 2.0)
    omega = 2 * np.pi * 15.0
    force = np.zeros(n)
    force[7] = 2.0
    expected = abs(linalg.solve(stiffness.toarray() - omega**2 * mass + 1j * omega * damping.toarray(), force))
    found = model.response(15.0)["curve"]
    np.testing.assert_allclose([found[f"{place}_amplitude_m"][0] for place in places], expected, rtol=1e-7)
    # add a joint and a lumped damper
    model.mass("damper", 0.05)
    model.spring("damper", "p3", stiffness=1e4)
    model.joint("rub", "damper", "p9", stickslip.law("jenkins", stiffness=5e3, limit=0.1))
    orbit = model.orbit(15.0, method="harmonic-balance", harmonics=9)
    assert orbit.evidence["energy_gap"] < 1e-6 and orbit.dissipation["rub"] > 0


def test_nodes_of_matrices_take_laws_of_several_directions():
    places = ["tip.x", "tip.y", "root"]
    stiffness = np.array([[3e4, 0, -1e4], [0, 2e4, 0], [-1e4, 0, 5e4]])
    model = stickslip.Model.from_matrices(np.eye(3), stiffness, 1e-4 * stiffness, places=places)
    model.joint("rub", "tip", "ground", stickslip.law("jenkins-2d", stiffness="1e4 N/m", limit=1.0))
    model.force("tip.x", 5.0)
    model.force("tip.y", 5.0, phase="90 deg")
    lumped = stickslip.Model()
    lumped.mass("tip", 1.0, directions=["x", "y"])
    lumped.mass("root", 1.0)
    lumped.spring("tip.x", "root", stiffness=1e4, damping=1.0)
    for place, value in (("tip.x", 2e4), ("tip.y", 2e4), ("root", 4e4)):
        lumped.spring(place, "ground", stiffness=value, damping=1e-4 * value)
    lumped.joint("rub", "tip", "ground", stickslip.law("jenkins-2d", stiffness="1e4 N/m", limit=1.0))
    lumped.force("tip.x", 5.0)
    lumped.force("tip.y", 5.0, phase=np.pi / 2)
    one, other = (each.response([20.0, 22.0], method="harmonic-balance", harmonics=7)["curve"] for each in (model, lumped))
    for place in ("tip_x", "tip_y", "root"):
        np.testing.assert_allclose(one[f"{place}_amplitude_m"], other[f"{place}_amplitude_m"], rtol=1e-9)


def test_a_large_structure_is_reduced_to_what_is_looked_at():
    sparse = pytest.importorskip("scipy.sparse")
    linalg = pytest.importorskip("scipy.sparse.linalg")
    n = 3000  # a rod of masses and springs, clamped at its first end
    stiffness = 1e7 * sparse.diags([np.append(2 * np.ones(n - 1), 1.0), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1], format="csc")
    mass = 1e-3 * sparse.identity(n, format="csc")
    damping = 1e-5 * stiffness
    places = {"tip": n - 1, "middle": {"x": n // 2}}
    model = stickslip.Model.from_matrices(mass, stiffness, damping, places=places, reduce="200 Hz")
    model.force("tip", 3.0)
    omega = 2 * np.pi * 60.0
    force = np.zeros(n)
    force[-1] = 3.0
    expected = abs(linalg.spsolve((stiffness - omega**2 * mass + 1j * omega * damping).tocsc(), force))
    orbit = model.orbit("60 Hz")
    assert list(orbit.amplitude) == model.places == ["tip", "middle.x"] and orbit.start.size < 100
    np.testing.assert_allclose(list(orbit.amplitude.values()), expected[[n - 1, n // 2]], rtol=2e-4)
    sampled = orbit.sample(points=4096)["displacement_m"]
    np.testing.assert_allclose(abs(sampled).max(axis=0), expected[[n - 1, n // 2]], rtol=2e-4)


def test_weakly_coupled_equal_oscillators_are_reduced():
    n = 500  # all frequencies lie between 159.2 and 159.5 Hz
    stiffness = 1e5 * scipy.sparse.diags([-1e-3 * np.ones(n - 1), 1.002 * np.ones(n), -1e-3 * np.ones(n - 1)], [-1, 0, 1]).tocsr()
    mass, damping = 0.1 * scipy.sparse.eye(n), 1e-5 * stiffness
    model = stickslip.Model.from_matrices(mass, stiffness, damping, places={"tip": 0}, reduce=170.0)
    model.force("tip", 1.0)
    found = model.response([150.0, 159.3])["curve"]
    for frequency, amplitude in zip(found["frequency_Hz"], found["tip_amplitude_m"]):
        omega = 2 * np.pi * frequency
        dynamic = (stiffness - omega**2 * mass + 1j * omega * damping).tocsc()
        expected = abs(scipy.sparse.linalg.spsolve(dynamic, np.eye(n)[0])[0])
        assert amplitude == pytest.approx(expected, rel=1e-3)


def test_modes_begin_stuck_and_end_free():
    result = couple().modes((1e-6, 1.0), points=21)
    table = result["modes"]
    # the in-phase mode does not move the joint: its frequency is that of a blade
    alone = np.sqrt(STIFFNESS / MASS) / (2 * np.pi)
    second = couple().modes((1e-6, 1.0), mode=2, points=21)["modes"]["frequency_Hz"]
    stuck = np.sqrt((STIFFNESS + 2 * CONTACT) / MASS) / (2 * np.pi)
    both = np.sort([table["frequency_Hz"][0], second[0]])
    np.testing.assert_allclose(both, [alone, stuck], rtol=1e-3)
    assert second[-1] == pytest.approx(alone, rel=1e-3)
    known = couple().check()
    np.testing.assert_allclose(known["free_Hz"], [alone, alone], rtol=1e-12)
    np.testing.assert_allclose(known["stuck_Hz"], [alone, stuck], rtol=1e-12)


def test_modes_have_the_notes_of_the_study():
    with pytest.raises(stickslip.ModelError, match="mode 3: the structure has no such mode"):
        couple().modes((1e-6, 1.0), mode=3)
    # sliding of a rigid joint exceeds critical damping at small amplitudes
    model = stickslip.Model()
    model.mass("b", 1.0)
    model.spring("b", "ground", stiffness=1e4)
    model.joint("j", "b", "ground", stickslip.law("coulomb", limit=1.0))
    notes = model.modes((1e-5, 1e-1), points=9).notes
    assert any("the damping ratio exceeds 1" in note for note in notes), notes


def test_laws_take_quantities_and_say_what_they_miss():
    law = stickslip.law("jenkins", stiffness="10 N/mm", limit=2)
    assert law.parameters == {"stiffness": 1e4, "limit": 2.0} and law.directions == 1
    assert set(stickslip.laws()) >= {"coulomb", "jenkins", "iwan", "friction-contact"}
    bouc = stickslip.law("bouc-wen", stiffness=1e4, beta="1e6 m^-2", gamma=0.0, exponent=2)
    assert bouc.parameters["beta"] == 1e6
    for name, parameters, match in [
        ("jenkin", {}, "the laws are coulomb"),
        ("jenkins", {"limit": 2}, "stiffness"),
        ("jenkins", {"limit": 2, "stiffness": "3 N"}, "stiffness.*force"),
        ("jenkins", {"limit": -2, "stiffness": 3}, "zero or more"),
        ("jenkins", {"limit": 2, "stiffness": 3, "mu": 0.1}, "no parameter `mu`"),
        ("jenkins", {"limit": float("nan"), "stiffness": 3}, "finite"),
        ("jenkins", {"limit": None, "stiffness": 3}, "a number in SI units or a string"),
        ("coulomb", {"limit": "2 Newton"}, "limit"),
    ]:
        with pytest.raises(stickslip.ModelError, match=match):
            stickslip.law(name, **parameters)


def test_wrong_models_are_refused_with_words():
    model = couple()
    for match, call in [
        ("`nobody`", lambda: couple_with(lambda m: m.force("nobody", 1.0))),
        ("unknown method `newmark`", lambda: model.orbit(121, method="newmark")),
        ("no option `harmonic`", lambda: model.orbit(121, method="harmonic-balance", harmonic=3)),
        ("whole number", lambda: model.orbit(121, method="harmonic-balance", harmonics=2.5)),
        ("frequency", lambda: model.orbit("121 N")),
        ("4 numbers", lambda: model.orbit(121, start=np.zeros(2))),
        ("no parameter", lambda: model.response(121, vary={"shroud.mu": [1, 2]})),
        ("2 values, but 3", lambda: model.response([121, 122, 123], vary={"shroud.limit": [1, 2]}) and None),
        ("more than zero", lambda: model.response(121, vary={"shroud.stiffness": [1e4, 0]})),
        ("needs one value", lambda: model.set({"shroud.limit": [1, 2]})),
        ("no values", lambda: model.response([])),
        ("2 x 3", lambda: stickslip.Model.from_matrices(np.eye(2), np.ones((2, 3)), places=["a", "b"])),
        ("not symmetric", lambda: stickslip.Model.from_matrices(np.eye(2), [[1, 2], [0, 1]], places=["a", "b"])),
        ("finite", lambda: stickslip.Model.from_matrices(np.eye(2), [[1, np.nan], [0, 1]], places=["a", "b"])),
        ("1x", lambda: stickslip.Model.from_matrices(np.eye(1), np.eye(1), places=["1x"])),
    ]:
        with pytest.raises((stickslip.ModelError, stickslip.MethodError), match=match):
            call()
    with pytest.raises(stickslip.OrbitError):
        model.orbit(0.0)
    with pytest.raises(stickslip.MethodError, match="event-driven does not accept"):
        law = stickslip.law("dahl", stiffness=1e4, limit=2)
        couple(law).orbit(121, method="event-driven")


def couple_with(change):
    model = couple()
    change(model)
    return model.orbit(121)


def test_complex_matrices_are_refused():
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]]) * (1 + 0.05j)
    for wrap in (np.asarray, scipy.sparse.csr_matrix):
        with pytest.raises(stickslip.StickslipError, match="stiffness matrix is complex"):
            stickslip.Model.from_matrices(np.eye(2), wrap(stiffness), places=["a", "b"])


@pytest.mark.parametrize(
    "wrong",
    [np.ma.array([[2.0, -1.0], [-1.0, 2.0]], mask=[[0, 1], [1, 0]]), np.array([["2", "-1"], ["-1", "2"]]), np.eye(2, dtype=bool), (row for row in np.eye(2))],
    ids=["masked", "texts", "flags", "generator"],
)
def test_matrices_without_real_numbers_are_refused(wrong):
    with pytest.raises(stickslip.ModelError, match="stiffness matrix must be an array of real numbers or a sparse matrix, found"):
        stickslip.Model.from_matrices(np.eye(2), wrong, places=["a", "b"])


def test_a_damping_ratio_asks_for_a_reduction():
    with pytest.raises(stickslip.StickslipError, match="requires `reduce`"):
        stickslip.Model.from_matrices(np.eye(2), 2 * np.eye(2), places=["a", "b"], damping_ratio=0.01)


def test_instants_and_starts_are_checked():
    model = couple()
    orbit = model.orbit(121.0)
    for points in (0, 10**10):
        with pytest.raises(stickslip.StickslipError, match="`points` must be"):
            orbit.sample(points=points)
        with pytest.raises(stickslip.StickslipError, match="`points` must be"):
            orbit.hysteresis(points=points)
    with pytest.raises(stickslip.StickslipError, match="non-finite"):
        model.orbit(121.0, start=np.full(len(orbit.start), np.nan))
    with pytest.raises(stickslip.StickslipError, match="orbits of this model by this method have"):
        model.orbit(121.0, start=np.zeros(len(orbit.start) + 3))


SECTOR = """schema = 1
[disk]
sectors = 6
{mistuning}
[[mass]]
name = "blade"
mass = "300 g"
[[spring]]
between = ["blade", "ground"]
stiffness = "150 N/mm"
damping = "0.3 kg/s"
[[joint]]
name = "shroud"
between = ["blade", "next.blade"]
law = {{ kind = "jenkins", stiffness = "10 N/mm", limit = "3 N" }}
[[force]]
on = "blade"
amplitude = "1 N"
engine_order = 2
[study]
kind = "response"
frequency = ["112 Hz", "115 Hz", "118 Hz"]
[method]
kind = "harmonic-balance"
harmonics = 3
"""


def sector():
    model = stickslip.Model()
    model.mass("blade", "300 g")
    model.spring("blade", "ground", stiffness="150 N/mm", damping="0.3 kg/s")
    model.joint("shroud", "blade", "next.blade", stickslip.law("jenkins", stiffness="10 N/mm", limit="3 N"))
    model.force("blade", "1 N", engine_order=2)
    return model


@pytest.mark.parametrize(
    ("stated", "given"),
    [
        ("", None),
        (
            'mistuning = { of = ["blade", "ground"], deviation = "2 %", seed = 7 }',
            {"of": ("blade", "ground"), "deviation": "2 %", "seed": 7},
        ),
        ('mistuning = { of = "blade", deviation = 0.02 }', {"of": "blade", "deviation": 0.02}),
    ],
)
def test_a_disk_by_calls_is_that_of_the_study_file(stated, given):
    study = stickslip.Study.from_text(SECTOR.format(mistuning=stated))
    expected = study.run(threads=1)["curve"]
    ring = sector().disk(6, mistuning=given)
    found = ring.response([112, 115, 118], method="harmonic-balance", harmonics=3, threads=1)["curve"]
    for place in ring.places:
        for column in (f"{place}_amplitude_m", f"{place}_phase_deg"):
            np.testing.assert_array_equal(found[column], expected[column])


def test_a_measured_pattern_and_wrong_disks():
    ring = sector().disk(3, mistuning={"of": "blade", "deviation": [0.01, "-2 %", 0]})
    # ω² = k/m of uncoupled blades
    free = np.sort(np.sqrt(150e3 / (0.3 * (1 + np.array([0.01, -0.02, 0])))) / (2 * np.pi))
    np.testing.assert_allclose(ring.check()["free_Hz"], free, rtol=1e-12)
    # a mistuned ring is not solved as a wave on one sector
    tuned = sector().disk(3)
    tuned.set({"blade_1.mass": 0.33})
    one = tuned.orbit(115, method="harmonic-balance", harmonics=1).amplitude
    assert one["blade_1"] != pytest.approx(one["blade_0"], rel=1e-3)
    for call, match in [
        (lambda: sector().orbit(115), "one sector"),
        (lambda: sector().disk(1), "at least 2 sectors"),
        (lambda: sector().disk(10**9), "exceed the limit of 20000"),
        (lambda: tuned.disk(3), "already a disk"),
        (lambda: sector().disk(3, mistuning={"of": "vane", "deviation": 0.1}), "no mass `vane`"),
        (lambda: sector().disk(3, mistuning={"of": ("blade", "disk"), "deviation": 0.1}), "no spring between"),
        (lambda: sector().disk(3, mistuning={"of": "blade"}), "needs `deviation`"),
        (lambda: sector().disk(3, mistuning={"of": "blade", "deviation": [0.1]}), "has 3 sectors"),
        (lambda: sector().disk(3, mistuning={"of": "blade", "deviation": [0, -1, 0]}), "no stiffness or mass remains"),
        (lambda: sector().disk(3, mistuning={"of": "blade", "deviations": 1}), "has no key"),
        (lambda: sector().force("blade", 1, engine_order=1, sector=2), "exclude each other"),
    ]:
        with pytest.raises(stickslip.ModelError, match=match):
            call()


def test_a_bar_on_two_springs_heaves_and_pitches():
    mass, length, stiffness = 3.0, 0.8, 1e4
    model = stickslip.Model()
    model.body("bar", mass, mass * length**2 / 12, directions=["x", "z"])
    for name, x in (("left", -length / 2), ("right", length / 2)):
        model.place(name, "bar", offset=[x, 0, 0])
        model.spring(f"{name}.z", "ground", stiffness=stiffness)
    model.spring("bar.x", "ground", stiffness=stiffness)
    expected = np.sqrt(np.array([1, 2, 6]) * stiffness / mass) / (2 * np.pi)
    np.testing.assert_allclose(model.check()["free_Hz"], expected, rtol=1e-12)
    # a moment turns the bar: theta = M / (k L^2 / 2 - J omega^2)
    model.force("bar.ry", "3 N m")
    omega = 2 * np.pi * 5.0
    turn = 3.0 / (stiffness * length**2 / 2 - mass * length**2 / 12 * omega**2)
    found = model.response(5.0)["curve"]
    assert found["bar_ry_amplitude_rad"][0] == pytest.approx(abs(turn), rel=1e-9)
    assert found["right_z_amplitude_m"][0] == pytest.approx(abs(turn) * length / 2, rel=1e-9)
    # parameters of the body and of its springs have their own dimensions
    model.spring("bar.ry", "ground", stiffness="100 N m/rad", damping="0.1 N m s/rad")
    model.set({"bar.mass": "4 kg", "bar.ry-ground.stiffness": "200 N m/rad", "bar.ry.force": "2 N m"})
    for value in ({"bar.ry-ground.stiffness": "200 N/m"}, {"bar.ry.force": "2 N"}):
        with pytest.raises(stickslip.ModelError, match="expected"):
            model.set(value)


WEDGE = """
schema = 1
body = [{ name = "wedge", mass = "50 g", inertia = "2000 g mm^2", directions = ["x", "z"] }]
place = [
    { name = "left", of = "wedge", offset = ["-6 mm", 0, "3 mm"], normal = [-1, 0, 1] },
    { name = "right", of = "wedge", offset = ["6 mm", 0, "3 mm"], normal = [1, 0, 1] },
]
joint = [
    { name = "l", between = ["left", "ground"], law = { kind = "jenkins-2d", stiffness = "1e5 N/m", limit = "1 N" } },
    { name = "r", between = ["right", "ground"], law = { kind = "jenkins-2d", stiffness = "2e5 N/m", limit = "2 N" } },
]
spring = [
    { between = ["wedge.x", "ground"], stiffness = "1e4 N/m", damping = "1 kg/s" },
    { between = ["wedge.z", "ground"], stiffness = "1e4 N/m", damping = "1 kg/s" },
    { between = ["wedge.ry", "ground"], stiffness = "1 N m/rad", damping = "1e-3 N m s/rad" },
]
force = [{ on = "wedge.x", amplitude = "3 N" }]
study = { kind = "response", frequency = ["90 Hz"] }
method = { kind = "harmonic-balance", harmonics = 5 }
"""


def wedge():
    model = stickslip.Model()
    model.body("wedge", "50 g", "2000 g mm^2", directions=["x", "z"])
    model.place("left", "wedge", offset=["-6 mm", 0, "3 mm"], normal=[-1, 0, 1])
    model.place("right", "wedge", offset=np.array([6e-3, 0, 3e-3]), normal=np.array([1, 0, 1]))
    for name, on, stiffness, limit in (("l", "left", 1e5, 1.0), ("r", "right", 2e5, 2.0)):
        model.joint(name, on, "ground", stickslip.law("jenkins-2d", stiffness=stiffness, limit=limit))
    for along in "xz":
        model.spring(f"wedge.{along}", "ground", stiffness=1e4, damping=1.0)
    model.spring("wedge.ry", "ground", stiffness=1.0, damping=1e-3)
    model.force("wedge.x", 3.0)
    return model


def test_a_wedge_by_calls_is_the_wedge_of_a_study():
    study = stickslip.Study.from_text(WEDGE)
    one = wedge().response(90.0, method="harmonic-balance", harmonics=5)["curve"]
    other = study.run()["curve"]
    for column in ("wedge_x_amplitude_m", "wedge_ry_amplitude_rad", "left_n_amplitude_m", "l_dissipation_J"):
        assert one[column][0] == pytest.approx(other[column][0], rel=1e-9) and one[column][0] > 0


def test_wrong_bodies_are_refused_with_words():
    model = wedge()
    for match, call in [
        ("2 moments of inertia for the rotations ry", lambda: model.body("b", 1, [1, 2], directions=["x", "z"])),
        ("inertia of `b`.*expected moment of inertia", lambda: model.body("b", 1, "3 kg", directions=["x", "z"])),
        ("no body `b`", lambda: model.place("p", "b", offset=[0, 0, 0])),
        ("needs `offset`, `normal` or both", lambda: model.place("p", "wedge")),
        ("three components, found 2", lambda: model.place("p", "wedge", offset=[0, 0])),
        ("does not move along y", lambda: model.place("p", "wedge", normal=[0, 1, 0])),
        ("`offset` of `p`", lambda: model.place("p", "wedge", offset=["1 N", 0, 0])),
    ]:
        with pytest.raises(stickslip.ModelError, match=match):
            call()
    model.body("b", 1, 0, directions=["x", "z"])
    with pytest.raises(stickslip.ModelError, match="body `b`, `inertia`"):
        model.orbit(90)


def test_errors_name_the_part():
    model = stickslip.Model()
    model.mass("a", 1)
    model.spring("a", "b", stiffness=1)
    with pytest.raises(stickslip.ModelError, match="spring between `a` and `b`, `between`"):
        model.orbit(1)
    model = stickslip.Model()
    model.mass("a", -1)
    with pytest.raises(stickslip.ModelError, match="mass `a`, `mass`"):
        model.orbit(1)


@pytest.mark.parametrize(
    "wrong",
    [
        b"121 Hz",
        bytearray(b"121"),
        memoryview(b"121"),
        {121.0: 1},
        {"frequency": 121.0},
        {121.0},
        frozenset([121.0]),
        np.ma.array([121.0, 122.0], mask=[False, True]),
        np.ma.masked,
        121 + 0j,
        np.complex128(121),
        np.complex64(121),
        np.array([121.0 + 1j]),
        [121.0, 1j],
        True,
        np.bool_(True),
        np.array([True]),
        np.array([b"121 Hz"]),
        np.array([[121.0]]),
        np.datetime64("2020-01-01"),
        None,
        [[121.0]],
        float("nan"),
        [121.0, float("inf")],
    ],
    ids=lambda wrong: f"{type(wrong).__name__}-{wrong!r}"[:40],
)
def test_what_is_no_number_is_refused_with_words(wrong):
    model = couple()
    with pytest.raises(stickslip.ModelError, match="frequency must be"):
        model.response(wrong)
    with pytest.raises(stickslip.ModelError, match="`shroud.limit` must be"):
        model.response(121, vary={"shroud.limit": wrong})
    with pytest.raises(stickslip.ModelError, match="frequency must be"):
        model.orbit(wrong)
    with pytest.raises(stickslip.ModelError, match="mass of `c` must be"):
        model.mass("c", wrong)


@pytest.mark.parametrize(
    "right",
    [
        [121, 122],
        (121.0, "122 Hz"),
        range(121, 123),
        np.array([121, 122]),
        np.array([121, 122], dtype=np.float32),
        np.array([121, 122], dtype=np.uint8),
        np.array(["121 Hz", "122 Hz"]),
        [np.float64(121), np.int32(122)],
        (frequency for frequency in (121, 122)),
        [np.array(121.0), np.array(122)],
    ],
    ids=lambda right: type(right).__name__,
)
def test_every_list_of_numbers_is_taken(right):
    assert couple().response(right)["curve"]["frequency_Hz"].tolist() == [121.0, 122.0]


def test_numbers_of_numpy_and_lists_are_taken_wherever_numbers_are():
    pandas, fractions = pytest.importorskip("pandas"), pytest.importorskip("fractions")
    model = stickslip.Model()
    model.mass("m", np.float32(1.0))
    model.spring("m", "ground", stiffness=np.int64(10_000), damping=fractions.Fraction(1, 2))
    model.force("m", np.array(2.0), phase=np.float16(0.5), harmonic=np.int8(1))
    assert model.response(pandas.Series([10.0, 11.0]))["curve"]["frequency_Hz"].tolist() == [10.0, 11.0]
    orbit = model.orbit(np.uint16(10))
    assert orbit.amplitude == model.orbit(10.0).amplitude
    again = model.orbit(10.0, start=list(orbit.start))
    assert again.amplitude["m"] == pytest.approx(orbit.amplitude["m"], rel=1e-9)
    assert orbit.sample([0.0, 0.01])["time_s"].tolist() == [0.0, 0.01]
    assert orbit.sample(np.float32(0.5))["time_s"].tolist() == [0.5]
    with pytest.raises(stickslip.ModelError, match="`times` must be one number or a list of numbers in SI units, found str"):
        orbit.sample("0.01 s")
    assert orbit.sample(points=np.int64(4))["time_s"].shape == (4,)
    model.joint("j", "m", "ground", stickslip.law("cubic", stiffness=np.float64(1e9)))
    assert len(model.modes(np.array([1e-4, 1e-3]), points=np.int64(3), harmonics=3, samples=64)["modes"]) >= 3
    assert stickslip.Study.from_template("element").set(Ft=np.float32(2.5)).parameters()["Ft"] == 2.5
    with pytest.raises(stickslip.ModelError, match="finite number"):
        stickslip.Study.from_template("element").set(Ft=2.5 + 0j)
    with pytest.raises(stickslip.ModelError, match="two numbers"):
        model.modes([1e-4])
