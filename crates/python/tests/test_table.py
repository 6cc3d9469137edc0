"""Tables as mappings, arrays, frames and pages; results, models, laws and orbits as copies and pickles."""

import copy
import pickle
from collections.abc import Mapping

import numpy as np
import pytest
from conftest import couple
from test_model import wedge

import stickslip

ELEMENT = stickslip.Study.from_template("element")


@pytest.fixture(scope="module")
def lossy():
    """A result with a point without an orbit: at the resonance of an undamped mass."""
    model = stickslip.Model()
    model.mass("m", 1.0)
    model.spring("m", "ground", stiffness=(2 * np.pi * 3) ** 2)
    model.force("m", 1.0)
    return model.response([2.0, 3.0, 4.0])


@pytest.fixture(scope="module")
def table(lossy):
    return lossy["curve"]


def test_a_table_is_a_mapping_of_its_columns(table):
    assert isinstance(table, Mapping) and isinstance(table, stickslip.Table)
    assert list(table) == list(table.keys()) == table.columns
    assert [name for name, _ in table.items()] == table.columns and len(table.values()) == len(table.columns)
    assert "frequency_Hz" in table and "frequency" not in table and 3 not in table
    assert table.get("nothing") is None and table.get("nothing", 5) == 5 and table.get(0) is None
    for wrong in ("nothing", 0):
        with pytest.raises(KeyError, match="the columns are"):
            table[wrong]
    assert dict(table)["frequency_Hz"].tolist() == {**table}["frequency_Hz"].tolist() == [2.0, 3.0, 4.0]
    assert table.row(-1)["frequency_Hz"] == table.row(len(table) - 1)["frequency_Hz"] == 4.0
    with pytest.raises(IndexError):
        table.row(-4)


def test_frames_have_the_columns_of_the_table(table):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    frame = pandas.DataFrame(table)
    assert list(frame.columns) == table.columns and len(frame) == len(table)
    np.testing.assert_array_equal(frame["m_amplitude_m"], table["m_amplitude_m"])
    assert frame["status"].tolist() == table["status"].tolist()
    frame = polars.DataFrame(table)
    assert frame.columns == table.columns and frame["status"].to_list() == table["status"].tolist()
    np.testing.assert_array_equal(frame["m_amplitude_m"].to_numpy(), table["m_amplitude_m"])
    # NaN becomes null in Arrow
    assert table.to_polars()["m_amplitude_m"].null_count() == 1
    pyarrow = pytest.importorskip("pyarrow")
    assert pyarrow.table(table)["m_amplitude_m"].null_count == 1


def test_an_array_has_the_shape_of_the_table(table):
    loops = ELEMENT.run()["loops"]
    numbers = [name for name in loops.columns if loops[name].dtype.kind == "f"]
    whole = np.asarray(loops)
    assert whole.shape == loops.shape
    for name in numbers:
        np.testing.assert_array_equal(whole[:, loops.columns.index(name)].astype(float), loops[name])
    mixed = np.asarray(table)
    assert mixed.shape == table.shape and mixed.dtype == object and mixed[0, table.columns.index("status")] == "converged"
    with pytest.raises(ValueError):
        np.asarray(table, dtype=float)


def test_a_table_shows_itself(table):
    page = table._repr_html_()
    assert all(f"<th>{name}</th>" in page for name in table.columns) and "3 rows" in page and "converged" in page
    long = ELEMENT.run()["loops"]._repr_html_()
    assert "…" in long and long.count("<tr>") == 12


def test_a_result_equals_itself_and_its_pickle(lossy):
    assert np.isnan(lossy["curve"]["m_amplitude_m"]).any()
    again = pickle.loads(pickle.dumps(lossy))
    assert lossy == lossy and again == lossy and copy.deepcopy(lossy) == lossy and copy.copy(lossy) is lossy
    assert pickle.loads(pickle.dumps(lossy["curve"])) == lossy["curve"] == copy.deepcopy(lossy["curve"])
    couple_of_blades = stickslip.Study.from_template("blade-couple").run()
    assert couple_of_blades == couple_of_blades and couple_of_blades != lossy and lossy != 3
    assert lossy["curve"] != couple_of_blades["curve"]


def test_saving_writes_what_the_command_writes(command, tmp_path):
    file = tmp_path / "element.toml"
    file.write_text(ELEMENT.text)
    command("run", file, "--out", tmp_path / "command")
    written = ELEMENT.run().save(tmp_path / "python")
    names = {path.name for path in written}
    assert names == {path.name for path in (tmp_path / "command" / "element").iterdir()}
    assert {path.suffix for path in written} == {".csv", ".json", ".svg", ".png", ".html"}
    for number, only in enumerate([("parquet",), "parquet", "csv, parquet"]):
        assert [path.suffix for path in ELEMENT.run().save(tmp_path / str(number), only=only)].count(".parquet") == 2


MODULE_LAW = stickslip.rate_law(lambda u, v, z: 1e9 * u**3, name="lambda")


@stickslip.rate_law(states=1, parameters={"stiffness": 1e4, "limit": 2.0}, scale="limit", odd=True)
def dahl(u, v, z, stiffness, limit):
    return limit * z[0], stiffness / limit * (v - abs(v) * z)


def test_laws_are_copied_and_pickled():
    for each in (stickslip.law("jenkins", stiffness=1e4, limit=2.0), dahl, stickslip.law("dahl", stiffness=1e4, limit=2.0)):
        again = pickle.loads(pickle.dumps(each))
        assert again == each and again.parameters == each.parameters and hash(again) == hash(each)
        assert copy.copy(each) is each and copy.deepcopy([each])[0] is each
    with pytest.raises(pickle.PicklingError, match="at module level"):
        pickle.dumps(MODULE_LAW)


def models():
    yield "couple", couple()
    yield "written", couple(dahl)
    yield "study", stickslip.Study.from_template("blade-couple").model(2)
    sector = stickslip.Model()
    sector.mass("blade", "300 g", directions=["x", "y"])
    for along in "xy":
        sector.spring(f"blade.{along}", "ground", stiffness="150 N/mm", damping="0.3 kg/s")
    sector.joint("shroud", "blade", "next.blade", stickslip.law("jenkins-2d", stiffness="10 N/mm", limit="3 N"))
    sector.force("blade.x", "1 N", engine_order=2, phase="30 deg")
    yield "ring", sector.disk(6, mistuning={"of": "blade", "deviation": "2 %", "seed": 7})
    stiffness = np.array([[3e4, 0, -1e4], [0, 2e4, 0], [-1e4, 0, 5e4]])
    model = stickslip.Model.from_matrices(np.eye(3), stiffness, places=["tip.x", "tip.y", "root"], damping_ratio=0.01, reduce=200)
    model.joint("rub", "tip", "ground", stickslip.law("jenkins-2d", stiffness="1e4 N/m", limit=1.0))
    model.force("tip.x", 5.0)
    model.motion("root", 1e-4)
    yield "matrices", model
    yield "bodies", wedge()


@pytest.mark.parametrize("model", [pytest.param(model, id=name) for name, model in models()])
def test_models_and_orbits_are_copied_and_pickled(model):
    options = {"method": "harmonic-balance", "harmonics": 3}
    orbit = model.orbit(30.0, **options)
    for again in (pickle.loads(pickle.dumps(model)), copy.copy(model), copy.deepcopy(model)):
        assert repr(again) == repr(model) and again.places == model.places
        assert (again.orbit(30.0, **options).start == orbit.start).all()
    loaded = pickle.loads(pickle.dumps(orbit))
    assert (loaded.start == orbit.start).all() and loaded.amplitude == orbit.amplitude and loaded.frequency_Hz == orbit.frequency_Hz
    assert copy.deepcopy(orbit) is orbit
    # an orbit belongs to the model at the time of the search
    force = next(iter(model.places))
    model.force(force, 0.5)
    assert (pickle.loads(pickle.dumps(orbit)).start == orbit.start).all()


def test_a_copied_model_is_another_one():
    model = couple()
    other = copy.deepcopy(model)
    other.set({"shroud.limit": 3.0})
    assert model.orbit(121).amplitude != other.orbit(121).amplitude
    sector = stickslip.Model()
    sector.mass("blade", 1.0)
    sector.spring("blade", "ground", stiffness=1e4, damping=1.0)
    sector.force("blade", 1.0, nodal_diameter=2)
    again = pickle.loads(pickle.dumps(sector)).disk(6).orbit(10.0)
    assert again.amplitude == sector.disk(6).orbit(10.0).amplitude
    # this also holds for a given initial guess
    begun = model.orbit(121.0)
    near = model.orbit(121.1, start=list(begun.start))
    assert (pickle.loads(pickle.dumps(near)).start == near.start).all()
