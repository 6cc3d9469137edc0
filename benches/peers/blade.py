"""A blade with 16 contact nodes, from its matrices to its response, by the program and beside SciPy.

    cargo build --release -p stickslip-cli
    python3 -m venv target/peers && target/peers/bin/pip install scipy==1.17.1
    target/peers/bin/python benches/peers/blade.py [--elements 90 36 6] [--out target/blade]

`scipy_blade.py` makes a twisted, tapered blade of steel of 8-node hexahedra, held at its root, with 16 nodes of a face on a damper (`friction-contact`,
three directions each). The commands of `stickslip` and the same work by SciPy follow, each in a process of its own on one thread. Printed are wall time,
that of the processor and peak memory of each as a table in Markdown, how far the frequencies in few coordinates are from those of all rows by `eigsh`, and how far the
response in few coordinates is from that of all rows.
"""

import argparse
import csv
import os
import subprocess
import sys
import time
from pathlib import Path

# Nothing large is imported here: the peak of a process counts what its parent held when it began.

HERE = Path(__file__).resolve().parent
# points of the response in few coordinates, and of that which all rows are solved for too
MANY, SOME = 61, 3
CONTACTS = 16
# wall time, time of the processor, memory
COLUMNS = "{:.1f} | {:.1f} | {:.0f}"
ONE = ["--threads", "1", "--only", "csv", "--out", "results"]


def study(name, structure, points, folder):
    text = f'''schema = 1
title = "Blade with {CONTACTS} contact nodes"

[parameters]
N = "200 N"

{structure}
[[joint]]
repeat = {{ i = {CONTACTS} }}
name = "c{{i}}"
between = ["p{{i}}", "ground"]
law = {{ kind = "friction-contact", tangential = "40 N/um / {CONTACTS}", normal = "60 N/um / {CONTACTS}", friction = 0.3, preload = "N / {CONTACTS}" }}

[[force]]
on = "tip"
amplitude = "40 N"

[study]
kind = "response"
frequency = {{ from = "300 Hz", to = "600 Hz", points = {points} }}
peaks = false

[method]
kind = "harmonic-balance"
harmonics = 5
tolerance = 0.01
'''
    (folder / f"{name}.toml").write_text(text)


def measured(command, **more):
    """Wall time and that of the processor (s), peak memory (MB) of a process, and what it said."""
    begin = time.perf_counter()
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    # 3: some points failed, which the comparison shows
    if code not in (0, 3):
        sys.exit(f"{command}: ended with {code}\n{said}")
    return time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3, said


def main():
    root = HERE.parents[1]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--elements", type=int, nargs=3, default=[90, 36, 6], help="along span, chord and thickness")
    parser.add_argument("--out", type=Path, default=root / "target/blade")
    parser.add_argument("--stickslip", type=Path, default=root / "target/release/stickslip")
    asked = parser.parse_args()
    out = asked.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    program = asked.stickslip.resolve()

    def scipy(step, *arguments):
        return measured([sys.executable, HERE / "scipy_blade.py", step, out, *arguments])

    def row(step, command, peer=None):
        *own, said = measured([program, *command], cwd=out)
        other = COLUMNS.format(*scipy(peer)) if peer else "| |"
        shown = command[: -len(ONE)] if command[-len(ONE) :] == ONE else command
        print(f"| {step} | `stickslip {' '.join(shown)}` | {COLUMNS.format(*own)} | {other} |", flush=True)
        return said

    print(scipy("make", *asked.elements)[-1])
    print("| step | command | s | of processor | MB | SciPy, s | of processor | MB |\n" + "| --- " * 8 + "|", flush=True)
    study("reduce", (out / "few.toml").read_text(), MANY, out)
    study("all", (out / "whole.toml").read_text(), SOME, out)
    row("read, factor", ["inspect", "stiffness.npz"], "factor")
    row("read, factor, 6 modes", ["inspect", "stiffness.npz", "mass.npz"], "modes")
    said = row("read, factor, 20 modes, reduce", ["reduce", "reduce.toml", "--out", "few"], "reduction")
    tables = (out / "few/structure.toml").read_text()
    study("many", tables, MANY, out / "few")
    study("some", tables, SOME, out / "few")
    row(f"solve, {MANY} points", ["run", "few/many.toml", *ONE])
    row(f"solve, {SOME} points", ["run", "few/some.toml", *ONE])
    row("the same in all rows", ["run", "all.toml", "--memory", "8 GB", *ONE])
    print("\n".join(["", said.strip(), scipy("compare")[-1].strip()]))
    few, every = curve(out / "results/some"), curve(out / "results/all")
    for frequency, (amplitude, status) in every.items():
        other, also = few[frequency]
        off = abs(other / amplitude - 1)
        print(f"{frequency} Hz: tip {1e6 * amplitude:.4f} um ({status}), in few coordinates off by {off:.1e} ({also})")


def curve(folder):
    """Amplitude of the tip and status by frequency."""
    with open(folder / "curve.csv") as file:
        rows = list(csv.DictReader(file))
    return {row["frequency_Hz"]: (float(row["tip_amplitude_m"] or "nan"), row["status"]) for row in rows}


if __name__ == "__main__":
    main()
