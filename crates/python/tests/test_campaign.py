"""Campaigns: on processes and on a Dask cluster, killed and resumed, with units that fail."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

import stickslip
from stickslip import _campaign

pytest.importorskip("pyarrow")

CASES = """
schema = 1
model = { template = "blade-couple-massless" }
[study]
kind = "response"
frequency = { from = "118 Hz", to = "124 Hz", points = 13 }
vary = { Ft = { from = "1 N", to = "4 N", points = 40 } }
"""


@pytest.fixture(scope="module")
def study():
    return stickslip.Study.from_text(CASES, name="many")


@pytest.fixture(scope="module")
def whole(study):
    return study.run()


def same_bits(one, other):
    for table in one:
        for column in one[table].columns:
            a, b = one[table][column], other[table][column]
            assert a.tobytes() == b.tobytes() if a.dtype != object else a.tolist() == b.tolist(), (table, column)


def test_processes_give_the_files_of_a_run(study, whole, tmp_path):
    seen = []
    done = stickslip.campaign(study, out=tmp_path / "c", processes=2, seconds=0.05, progress=lambda *pair: seen.append(pair))
    assert done.is_complete and not done.failed and seen[-1] == (study.units, study.units)
    assert len(done.files("curve")) > 2  # more than one batch
    result = done.result()
    same_bits(result, whole)
    assert result.figure == whole.figure and result.notes == whole.notes and result.points == whole.points
    written = result.save(tmp_path / "a", only=["csv", "svg"])
    whole.save(tmp_path / "b", only=["csv", "svg"])
    for path in written:
        if path.name != "record.json":
            assert path.read_bytes() == (tmp_path / "b" / "many" / path.name).read_bytes()
    # nothing is computed again
    stamps = {file: file.stat().st_mtime_ns for file in done.files("curve")}
    again = stickslip.campaign(study, out=tmp_path / "c")
    assert {file: file.stat().st_mtime_ns for file in again.files("curve")} == stamps


def test_parts_are_read_lazily_and_summed_up(study, whole, tmp_path):
    done = stickslip.campaign(study, out=tmp_path, processes=1, seconds=0.05)
    curve = whole["curve"]
    frame = pytest.importorskip("polars") and done.table("curve").collect()
    assert frame["blade1_amplitude_m"].to_numpy().tobytes() == curve["blade1_amplitude_m"].tobytes()
    assert done.table(library="pyarrow").count_rows() == len(curve)
    amplitude, frequency = curve["blade1_amplitude_m"], curve["frequency_Hz"]
    x, bands = done.percentiles("blade1_amplitude_m", (5, 50, 95), by="frequency_Hz")
    np.testing.assert_array_equal(x, np.unique(frequency))
    np.testing.assert_allclose(bands[3], np.percentile(amplitude[frequency == x[3]], [5, 50, 95]))
    np.testing.assert_allclose(done.percentiles("blade1_amplitude_m", 50), np.median(amplitude))
    level = float(np.median(amplitude))
    assert done.exceedance("blade1_amplitude_m", [0.0, level, 1.0]).tolist() == [1.0, np.mean(amplitude > level), 0.0]
    by = done.sensitivity("blade1_amplitude_m", ["Ft_N", "frequency_Hz"])
    assert 0 <= by["Ft_N"] < by["frequency_Hz"] <= 1
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    assert done.plot("blade1_amplitude_m", by="frequency_Hz").axes[0].get_xlabel() == "frequency_Hz"


def test_a_campaign_that_is_killed_goes_on(study, whole, tmp_path):
    (tmp_path / "study.toml").write_text(CASES)
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(
            """
            import stickslip
            if __name__ == "__main__":
                study = stickslip.Study.from_text(open("study.toml").read(), name="many")
                stickslip.campaign(study, out="c", processes=2, seconds=0.01)
            """
        )
    )
    kept = []
    for wait in (1, 2, 4):  # number of finished parts at the time of the kill
        process = subprocess.Popen([sys.executable, script], cwd=tmp_path, start_new_session=True)
        done = tmp_path / "c" / "done"
        deadline = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < deadline:
            if done.exists() and len(list(done.glob("*.json"))) >= len(kept) + wait:
                os.killpg(process.pid, signal.SIGKILL)
                break
            time.sleep(0.001)
        process.wait()
        kept = list(done.glob("*.json"))
        assert process.returncode == -signal.SIGKILL or len(kept) > 2
    # a part without its record counts as not computed
    orphan = tmp_path / "c" / "parts" / "curve" / f"{0:012}-{study.units:012}.parquet"
    orphan.write_bytes(b"half a file")
    finished = stickslip.campaign(study, out=tmp_path / "c", processes=2)
    same_bits(finished.result(), whole)


def test_a_folder_of_another_study_is_refused(study, tmp_path):
    stickslip.campaign(study.set(Ft="1 N"), out=tmp_path, processes=1)
    for other, words in [
        (study, "the same study with other values of parameters .Ft = 1 N"),
        (study.set(Ft="1 N").method("event-driven"), "the same study with another method"),
        (stickslip.Study.from_text(CASES.replace("13", "14"), name="many").set(Ft="1 N"), "another study: its line 6 is"),
    ]:
        with pytest.raises(stickslip.CampaignError, match=f"contains the campaign of {words}"):
            stickslip.campaign(other, out=tmp_path)
    with pytest.raises(stickslip.CampaignError, match="contains no campaign"):
        stickslip.Campaign(tmp_path / "nothing")
    with pytest.raises(stickslip.CampaignError, match="unknown table `curves`"):
        stickslip.Campaign(tmp_path).table("curves")
    (tmp_path / "campaign.json").write_text("{")
    with pytest.raises(stickslip.CampaignError, match="cannot be read"):
        stickslip.Campaign(tmp_path)


def test_a_lost_description_of_the_campaign_is_written_again(study, whole, tmp_path):
    first = stickslip.campaign(study, out=tmp_path, processes=1)
    stamps = {file: file.stat().st_mtime_ns for file in first.files("curve")}
    (tmp_path / "campaign.json").unlink()
    again = stickslip.campaign(study, out=tmp_path, processes=1)
    assert {file: file.stat().st_mtime_ns for file in again.files("curve")} == stamps
    same_bits(again.result(), whole)
    # parts of another study are computed again
    (tmp_path / "campaign.json").unlink()
    other = stickslip.Study.from_text(CASES.replace("4 N", "5 N"), name="many")
    with pytest.warns(UserWarning, match="belong to another campaign"):
        changed = stickslip.campaign(other, out=tmp_path, processes=1)
    same_bits(changed.result(), other.run())


def test_matrices_that_change_are_refused(tmp_path):
    def matrix(name, value):
        (tmp_path / name).write_text(f"%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 {value}\n")

    file = tmp_path / "blade.toml"
    file.write_text(
        """schema = 1
        structure = { stiffness = "k.mtx", mass = "m.mtx", units = "m-kg-s", modal_damping = 0.01 }
        place = [{ name = "tip", dof = "1" }]
        force = [{ on = "tip", amplitude = "1 N" }]
        study = { kind = "response", frequency = { from = "20 Hz", to = "40 Hz", points = 40 } }"""
    )
    matrix("m.mtx", 2.0)
    matrix("k.mtx", 8e4)
    study = stickslip.Study.from_file(file)
    stickslip.campaign(study, out=tmp_path / "c", processes=1)
    matrix("k.mtx", 8.1e4)
    with pytest.raises(stickslip.CampaignError, match="other matrices"):
        stickslip.campaign(stickslip.Study.from_file(file), out=tmp_path / "c")
    # worker processes see other files than the caller: this is not a failure of a unit
    with pytest.raises(stickslip.CampaignError, match="other matrices"):
        stickslip.campaign(study, out=tmp_path / "d", processes=1)
    assert not list((tmp_path / "d" / "done").iterdir())


def test_a_second_campaign_in_a_folder_is_refused_while_the_first_one_writes(study, whole, tmp_path):
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import stickslip
            if __name__ == "__main__":
                stickslip.campaign(stickslip.Study.from_text({CASES!r}, name="many"), out="c", processes=1, seconds=0.01)
            """
        )
    )
    first = subprocess.Popen([sys.executable, script], cwd=tmp_path)
    try:
        deadline = time.monotonic() + 60
        while not list((tmp_path / "c").glob("done/*.json")) and time.monotonic() < deadline:
            time.sleep(0.01)
        os.kill(first.pid, signal.SIGSTOP)
        with pytest.raises(stickslip.CampaignError, match="another campaign is writing into .*: wait until it ends"):
            stickslip.campaign(study, out=tmp_path / "c", processes=1)
        # reading is allowed during writing
        assert stickslip.Campaign(tmp_path / "c").points["converged"] > 0
    finally:
        os.kill(first.pid, signal.SIGCONT)
        assert first.wait(60) == 0
    again = stickslip.campaign(study, out=tmp_path / "c", processes=1)
    assert again.is_complete and sum(again.points.values()) == study.points
    same_bits(again.result(), whole)


def test_measured_data_that_change_are_refused(tmp_path):
    file = tmp_path / "shock.toml"
    file.write_text(
        """schema = 1
        data = [{ name = "record", file = "record.csv" }]
        mass = [{ name = "m", mass = "1 kg" }]
        spring = [{ between = ["m", "ground"], stiffness = "1 kN/m", damping = "1 kg/s" }]
        force = [{ on = "m", data = "record" }]
        study = { kind = "transient", duration = "0.1 s", time_step = "10 ms" }"""
    )
    (tmp_path / "record.csv").write_text("time_s,force_N\n0,1\n0.05,2\n0.1,1\n")
    stickslip.campaign(stickslip.Study.from_file(file), out=tmp_path / "c", processes=1)
    (tmp_path / "record.csv").write_text("time_s,force_N\n0,1\n0.05,3\n0.1,1\n")
    with pytest.raises(stickslip.CampaignError, match="other matrices or data"):
        stickslip.campaign(stickslip.Study.from_file(file), out=tmp_path / "c", processes=1)


@pytest.mark.parametrize("damage", ["missing", "cut", "flipped", "record", "records", "folder"])
def test_parts_that_are_missing_or_damaged_are_computed_again(study, whole, tmp_path, damage):
    done = stickslip.campaign(study, out=tmp_path, processes=1, seconds=0.05)
    part = done.files("curve")[1]
    record = tmp_path / "done" / f"{part.stem}.json"
    data = part.read_bytes()
    if damage == "missing":
        part.unlink()
    elif damage == "cut":
        part.write_bytes(data[: len(data) // 2])
    elif damage == "flipped":
        part.write_bytes(data[:40] + bytes([data[40] ^ 255]) + data[41:])
    elif damage == "record":
        record.write_bytes(record.read_bytes()[:10])
    elif damage == "records":
        start, stop = (int(number) for number in record.stem.split("-"))
        record.with_name(f"{start:012}-{stop + 1:012}.json").write_bytes(record.read_bytes())
    else:
        for file in (tmp_path / "parts" / "curve").iterdir():
            file.unlink()
        (tmp_path / "parts" / "curve").rmdir()
    seen = stickslip.Campaign(tmp_path)
    if damage != "flipped":  # only the checksum reveals a flipped bit
        assert seen.damaged and (damage == "records" or not seen.is_complete)
    if not seen.is_complete:
        with pytest.raises(stickslip.CampaignError, match="damaged or missing"):
            seen.result()
    with pytest.warns(UserWarning, match="damaged or missing parts"):
        repaired = stickslip.campaign(study, out=tmp_path, processes=1)
    assert repaired.is_complete and not repaired.damaged and repaired.points == whole.points
    result = repaired.result()
    assert len(result["curve"]) == len(whole["curve"]) == study.points
    same_bits(result, whole)


def test_a_script_without_its_guard_gets_one_error_and_its_correction_computes_all(tmp_path):
    script = tmp_path / "noguard.py"
    lines = ["import stickslip", "done = stickslip.campaign(stickslip.Study.from_template('blade-couple'), out='ng', processes=2)", "print('ok', done.failed)"]
    script.write_text("\n".join(lines))
    ended = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1 and "ok" not in ended.stdout
    assert ended.stderr.count("Traceback") == 1 and '__name__ == "__main__"' in ended.stderr and len(ended.stderr) < 5000
    assert not list((tmp_path / "ng" / "done").iterdir())
    corrected = [lines[0], 'if __name__ == "__main__":', *("    " + line for line in lines[1:])]
    script.write_text("\n".join(corrected))
    ended = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "ok {}\n", "")


def test_ctrl_c_ends_a_campaign_and_its_processes(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(
            """
            import signal, stickslip
            if __name__ == "__main__":
                signal.signal(signal.SIGINT, signal.default_int_handler)
                stickslip.campaign(stickslip.Study.from_text(LONG), out="c", processes=2, seconds=30)
            """
        ).replace("LONG", repr(CASES.replace("13", "400_001")))
    )
    process = subprocess.Popen([sys.executable, script], cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    while len(list((tmp_path / "c").glob("done/*.json"))) < 4 and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.5)
    pressed = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # a terminal also signals all processes
    _, errors = process.communicate(timeout=60)
    assert time.monotonic() - pressed < 1.5
    assert errors.count("Traceback") == 1 and "KeyboardInterrupt" in errors
    deadline = time.monotonic() + 30
    with pytest.raises(ProcessLookupError):
        while time.monotonic() < deadline:
            os.killpg(process.pid, 0)
            time.sleep(0.05)


class Scripted:
    """Workers that fail as they are told, in this process."""

    threads = 2

    def __init__(self, study, fails):
        self.study, self.fails, self.tried, self.running = study, fails, [], {}

    def submit(self, start, stop, tries, avoid):
        key = object()
        self.running[key] = (start, stop)
        self.tried.append((start, stop, avoid))
        return key

    def wait(self, running):
        return running[:1]

    def answer(self, future):
        start, stop = self.running[future]
        for unit in range(start, stop):
            if self.fails(unit, sum(first <= unit < last for first, last, _ in self.tried)):
                raise _campaign._Failed(f"unit {unit} broke down", "tcp://first")
        return _campaign._work(_campaign._pickled(self.study), start, stop)

    def close(self, at_once):
        pass


@pytest.mark.parametrize(
    "fails, lost", [(lambda unit, times: unit == 7, [7]), (lambda unit, times: unit % 9 == 4 and times < 2, [])], ids=["always", "once"]
)
def test_a_unit_that_fails_is_tried_elsewhere_and_kept_with_its_reason(study, whole, tmp_path, fails, lost):
    campaign = stickslip.Campaign._begin(study, tmp_path)
    workers = Scripted(study, fails)
    _campaign._compute(campaign, workers, campaign._missing(), 0.5, lambda units: None)
    finished = stickslip.Campaign(tmp_path)
    assert finished.is_complete and list(finished.failed) == lost
    assert any(avoid == "tcp://first" for _, _, avoid in workers.tried)
    if lost:
        assert finished.failed[7] == "unit 7 broke down"
        assert finished.table(library="pyarrow").count_rows() == len(whole["curve"]) * (study.units - 1) // study.units
        with pytest.raises(stickslip.CampaignError, match="units that failed"):
            finished.result()
        with pytest.warns(UserWarning, match="1 of .* units failed, the first is unit 7: unit 7 broke down"):
            assert stickslip.campaign(study, out=tmp_path, processes=1, retry=False).failed
        again = stickslip.campaign(study, out=tmp_path, processes=1)
        same_bits(again.result(), whole)
    else:
        same_bits(finished.result(), whole)


def test_a_dask_cluster_gives_the_same_bits_though_a_worker_is_killed(study, whole, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            killed = []

            def kill(done, total):
                if not killed:
                    killed.append(client.run(os.getpid))
                    os.kill(next(iter(killed[0].values())), signal.SIGKILL)

            done = stickslip.campaign(study, client=client, out=tmp_path, seconds=0.05, progress=kill)
            assert killed and done.is_complete and not done.failed
    same_bits(done.result(), whole)
    told = [json.loads(file.read_text()) for file in (tmp_path / "done").iterdir()]
    assert sum(sum(one["points"].values()) for one in told) == study.points


def test_what_a_campaign_cannot_begin_with(tmp_path):
    study = stickslip.Study.from_template("blade-couple", Ft="2 N")
    file = tmp_path / "file"
    file.write_text("")
    for wrong, error, words in [
        ({"study": "couple.toml"}, TypeError, "stickslip.Study"),
        ({"processes": 0}, ValueError, "from 1"),
        ({"seconds": -1.0}, ValueError, "more than zero"),
        ({"seconds": "5 s"}, ValueError, "found '5 s'"),
        ({"out": file}, NotADirectoryError, "is a file"),
    ]:
        given = {"study": study, "out": tmp_path / "out", **wrong}
        with pytest.raises(error, match=words):
            stickslip.campaign(given.pop("study"), **given)
        assert not (tmp_path / "out").exists()
