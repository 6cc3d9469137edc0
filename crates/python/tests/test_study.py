"""Studies and results: against the command, against themselves, against closed forms."""

import _thread
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import stickslip

ELEMENT = stickslip.Study.from_template("element")


def test_a_study_gives_the_files_of_the_command(command, tmp_path):
    file = tmp_path / "couple.toml"
    file.write_text(command("new", "blade-couple-massless", "-").stdout)
    command("run", file, "--out", tmp_path / "command", "--only", "csv,svg", "--set", "Ft=3 N")
    result = stickslip.Study.from_file(file, Ft="3 N").run(threads=1)
    written = result.save(tmp_path / "python", only=["csv", "svg"])
    assert len(written) > 2
    for path in written:
        if path.name != "record.json":  # it contains the wall time
            assert path.read_bytes() == (tmp_path / "command" / "couple" / path.name).read_bytes(), path.name


def test_the_loss_of_an_element_is_the_area_of_its_loop():
    parameters = ELEMENT.parameters(1)
    loss = ELEMENT.run()["loops_summary"]["dissipation_J"][1]
    limit, stiffness, amplitude = parameters["Ft"], parameters["kt"], parameters["a"]
    assert loss == pytest.approx(4 * limit * (amplitude - limit / stiffness), rel=1e-12)


def test_any_number_of_threads_gives_the_same_bits():
    study = stickslip.Study.from_template("blade-couple-massless")
    one, three = study.run(threads=1), study.run(threads=3)
    assert pickle.dumps(one["curve"]["blade1_amplitude_m"]) == pickle.dumps(three["curve"]["blade1_amplitude_m"])
    assert (one.record["threads"], three.record["threads"]) == (1, 3)


def test_a_dictionary_is_a_study():
    tables = {
        "schema": 1,
        "title": 'A "title" with ü and \\',
        "parameters": {"Ft": "2 N"},
        "mass": [{"name": "m", "mass": "1 kg"}],
        "spring": [{"between": ["m", "ground"], "stiffness": "100 N/m", "damping": "1 kg/s"}],
        "joint": [{"name": "rub", "between": ["m", "ground"], "law": {"kind": "coulomb", "limit": "Ft"}}],
        "force": [{"on": "m", "amplitude": "5 N"}],
        "study": {"kind": "response", "frequency": {"from": "1 Hz", "to": "2 Hz", "points": np.int64(3)}},
    }
    study = stickslip.Study.from_dict(tables, name="mine")
    assert (study.name, study.title, study.points) == ("mine", tables["title"], 3)
    assert study.parameters() == {"Ft": 2.0}
    # numbers are in SI
    assert study.set(Ft=2.5).parameters() == study.set(Ft="2500 mN").parameters() == {"Ft": 2.5}
    assert study.set(Ft=2.5).set(Ft="4 N").parameters() == {"Ft": 4.0}


@pytest.mark.parametrize("template", stickslip.templates())
def test_setting_the_parameters_of_a_study_changes_nothing(template):
    study = stickslip.Study.from_template(template)
    parameters = study.parameters()
    again = study.set(**parameters)
    assert again.parameters() == parameters
    if study.cases == 1:
        assert again.model().matrices.keys() == study.model().matrices.keys()


def test_frequencies_among_parameters_are_in_hertz():
    text = LONG.replace("[study]", '[parameters]\nspeed = "2000 rpm"\nFt = "2 N"\n[study]').replace("points = 200001", "points = 3")
    study = stickslip.Study.from_text(text.replace('from = "110 Hz"', 'from = "speed"'))
    assert study.parameters()["speed"] == pytest.approx(2000 / 60, rel=1e-15)
    assert study.set(speed=50).parameters()["speed"] == 50.0


def test_errors_have_the_text_of_the_command(command, tmp_path):
    file = tmp_path / "wrong.toml"
    file.write_text(command("new", "element", "-").stdout.replace("kt", "kx", 1).replace("law", "lwa"))
    shown = command("run", file, check=False)
    with pytest.raises(stickslip.StudyError) as caught:
        stickslip.Study.from_file(file)
    error = caught.value
    words = lambda text: [word for word in text.split() if word.isalnum()]  # noqa: E731
    assert words(shown.stderr) == words(str(error))
    assert error.file == str(file) and error.line > 0 and error.reason in " ".join(str(error).split())
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.line, again.help) == (str(error), error.line, error.help)
    with pytest.raises(ValueError):  # as Python's own parsers raise
        stickslip.Study.from_text("mass = ")
    with pytest.raises(stickslip.StudyError, match="no such file"):
        stickslip.Study.from_file(tmp_path / "absent.toml")


def test_studies_and_results_are_pickled_whole():
    study = ELEMENT.set(Ft="3 N").method("event-driven")
    again = pickle.loads(pickle.dumps(study))
    assert repr(again) == repr(study) and again.parameters() == study.parameters()
    result = study.run()
    back = pickle.loads(pickle.dumps(result))
    assert back.record == result.record and back.svg() == result.svg()
    for table in result:
        for column in result[table].columns:
            assert pickle.dumps(back[table][column]) == pickle.dumps(result[table][column])


def test_columns_are_lent_and_cannot_be_written():
    result = ELEMENT.run()
    column = result["loops"]["force_N"]
    del result
    assert not column.flags.owndata and not column.flags.writeable
    with pytest.raises(ValueError):
        column[0] = 1.0
    before = column.copy()
    ELEMENT.run()
    assert (column == before).all()


def test_arrow_reads_columns_where_they_lie():
    pyarrow = pytest.importorskip("pyarrow")
    table = ELEMENT.run()["loops"]
    arrow = pyarrow.table(table)
    assert arrow.column_names == table.columns and arrow.num_rows == len(table)
    buffer = arrow["force_N"].chunk(0).buffers()[1]
    assert buffer.address == table["force_N"].__array_interface__["data"][0]
    for name in table.columns:
        assert arrow[name].to_pylist() == table[name].tolist()
    del table
    assert arrow["force_N"].to_numpy().size == arrow.num_rows
    # a consumer may take the stream out of its capsule or leave it
    for _ in range(100):
        ELEMENT.run()["loops"].__arrow_c_stream__()


def test_pandas_and_polars_have_nulls_where_there_is_no_number():
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    # an undamped model excited at resonance has no orbit
    model = stickslip.Model()
    model.mass("m", 1.0)
    model.spring("m", "ground", stiffness=(2 * np.pi * 3) ** 2)
    model.force("m", 1.0)
    result = model.response([2.0, 3.0, 4.0])
    assert result.points == {"converged": 2, result["curve"]["status"][1]: 1} and len(result.failures) == 1
    frame = result["curve"].to_polars()
    assert frame["m_amplitude_m"].null_count() == 1 and frame["stable"][1] is None
    assert frame["iterations"].dtype == polars.UInt64
    data = result["curve"].to_pandas()
    assert pandas.isna(data["m_amplitude_m"][1]) and data["status"].tolist() == result["curve"]["status"].tolist()
    np.testing.assert_array_equal(data["m_amplitude_m"], result["curve"]["m_amplitude_m"])


LONG = """
schema = 1
model = { template = "blade-couple" }
[study]
kind = "response"
frequency = { from = "110 Hz", to = "130 Hz", points = 200001 }
"""


def test_a_run_is_stopped_by_what_progress_raises_and_tells_its_points():
    seen = []

    def progress(done, total):
        seen.append((done, total))
        if done > 100:
            raise RuntimeError("enough")

    begun = time.monotonic()
    with pytest.raises(RuntimeError, match="enough"):
        stickslip.Study.from_text(LONG).run(progress=progress)
    assert time.monotonic() - begun < 10
    assert seen[-1][1] == 200_001 and seen[-1][0] > 100


@pytest.fixture
def ctrl_c():
    """A process that Ctrl-C ends: a shell lets what it runs in the background ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield threading.Timer(0.7, _thread.interrupt_main)
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_a_run(ctrl_c):
    ctrl_c.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        stickslip.Study.from_text(LONG).run()
    assert time.monotonic() - begun < 5


def test_python_goes_on_while_a_study_runs():
    counted = 0
    thread = threading.Thread(target=lambda: stickslip.Study.from_template("blade-couple").run())
    thread.start()
    while thread.is_alive():
        counted += 1
        time.sleep(0.001)
    assert counted > 10


def test_a_figure_shows_itself():
    result = ELEMENT.run()
    assert result._repr_svg_().startswith("<svg") and "<svg" in result._repr_html_()
    assert result.png().startswith(b"\x89PNG")
    assert "dissipation" in str(result) or "loops" in str(result)
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    drawn = result.plot()
    lines = drawn.axes[0].get_lines()
    series = result.figure["panels"][0]["series"]
    assert len(lines) == len(series)
    np.testing.assert_array_equal(lines[0].get_xdata(), np.array(series[0]["x"], float))


def test_wrong_input_is_refused_with_words():
    result = ELEMENT.run()
    with pytest.raises(KeyError, match="loops_summary"):
        result["loop"]
    with pytest.raises(KeyError, match="displacement_m"):
        result["loops"]["displacement"]
    with pytest.raises(stickslip.ReportError, match="unknown|there is no|pdf"):
        result.save("/tmp", only=["pdf"])
    with pytest.raises(stickslip.StickslipError, match="1 to 1024"):
        ELEMENT.run(threads=0)
    with pytest.raises(stickslip.ModelError, match="blade-couple"):
        stickslip.Study.from_template("nothing")
    with pytest.raises(stickslip.StudyError):
        ELEMENT.set(nothing=3)
    with pytest.raises(stickslip.StudyError):
        ELEMENT.set(Ft="3 kg")
    with pytest.raises(TypeError):
        stickslip.Study.from_dict({"schema": object()})
    with pytest.raises(stickslip.ReportError):
        stickslip._core._result(b"no pickle")
