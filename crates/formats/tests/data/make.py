"""Writes the files of this folder: the same matrices by as many programs as there are, and what must be read from each, bit by bit.

    python3 -m venv venv && venv/bin/pip install numpy==2.4.6 scipy==1.17.1 h5py==3.16.0 pyyeti==1.4.7
    apt-get install calculix-ccx octave   # 2.20, 7.3.0
    venv/bin/python make.py

Nothing but these programs writes a file here, except `punch.pch`, OUTPUT2 and those of Abaqus and ANSYS, which follow their documentation, and
`chain_*`, a chain of three masses written by hand with what other programs add or leave out.
Expected values stand in `NAME.bits`: rows and columns, then `row column bits` of every entry, the bits as 16 hexadecimal digits.
"""

import shutil
import struct
import subprocess
import tempfile
import warnings
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import scipy.io
import scipy.sparse as sp
from pyyeti.nastran import op2, op4, wtdmig

HERE = Path(__file__).parent
warnings.simplefilter("ignore")

# Chains of six masses, with values that need all 53 bits, and a row without mass.
N = 6
k = np.array([1e5 / 3 * (i + 1) ** 0.5 for i in range(N + 1)])
STIFFNESS = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
STIFFNESS[0, 5] = STIFFNESS[5, 0] = 1e-17
MASS = np.diag([np.pi, 1 / 7, 0.0, 2.5e-310, 1e300, 3.0]) + 0.0
MASS[0, 1] = MASS[1, 0] = -1 / 9
GENERAL = np.zeros((4, 3))
GENERAL[0, 0], GENERAL[3, 0], GENERAL[1, 2], GENERAL[0, 2] = 1 / 3, -2.0, 1e-5, 7.0
WHOLE = np.array([[1.0, 2.0], [3.0, 250.0]])


def expect(name, matrix):
    matrix = sp.coo_matrix(matrix)
    lines = [f"{matrix.shape[0]} {matrix.shape[1]}"]
    entries = sorted(zip(matrix.col, matrix.row, matrix.data))
    lines += [f"{row} {column} {struct.pack('>d', value).hex()}" for column, row, value in entries if value != 0]
    (HERE / f"{name}.bits").write_text("\n".join(lines) + "\n")


def numpy_and_scipy():
    np.save(HERE / "stiffness.npy", STIFFNESS)
    np.savetxt(HERE / "savetxt.txt", STIFFNESS, header="stiffness")
    np.savetxt(HERE / "rows.csv", STIFFNESS, delimiter=",", fmt="%.17g")
    np.save(HERE / "general_fortran.npy", np.asfortranarray(GENERAL))
    np.save(HERE / "stiffness_big_endian.npy", STIFFNESS.astype(">f8"))
    np.savez(HERE / "dense.npz", K=STIFFNESS, M=MASS, note=np.array("text"), z=np.array([[1j]]))
    np.savez_compressed(HERE / "dense_compressed.npz", K=STIFFNESS, M=MASS)
    sp.save_npz(HERE / "stiffness_csc.npz", sp.csc_matrix(STIFFNESS), compressed=True)
    sp.save_npz(HERE / "stiffness_csr.npz", sp.csr_matrix(STIFFNESS), compressed=False)
    sp.save_npz(HERE / "general_coo.npz", sp.coo_matrix(GENERAL))
    wide = sp.csc_matrix(STIFFNESS)
    wide.indices, wide.indptr = wide.indices.astype(np.int64), wide.indptr.astype(np.int64)
    sp.save_npz(HERE / "stiffness_int64.npz", wide)
    scipy.io.mmwrite(HERE / "stiffness.mtx", sp.coo_matrix(STIFFNESS), precision=17)
    scipy.io.mmwrite(HERE / "general.mtx", sp.coo_matrix(GENERAL), precision=17)
    scipy.io.mmwrite(HERE / "general_array.mtx", GENERAL, precision=17)
    scipy.io.mmwrite(HERE / "whole_array.mtx", WHOLE.astype(int))
    scipy.io.hb_write(HERE / "general.rua", sp.csc_matrix(GENERAL))
    for name, compressed in [("v5.mat", False), ("v5_compressed.mat", True)]:
        variables = {
            "K": sp.csc_matrix(STIFFNESS),
            "M": MASS,
            "G": sp.csc_matrix(GENERAL),
            "bytes": WHOLE.astype(np.uint8),
            "single": WHOLE.astype(np.float32),
            "z": STIFFNESS * 1j,
            "label": "a text",
            "cells": np.array([1, "two"], dtype=object),
            "model": {"K": sp.csc_matrix(STIFFNESS), "inner": {"M": MASS}},
        }
        scipy.io.savemat(HERE / name, variables, do_compression=compressed)


def matlab_73():
    """As MATLAB does: a block of the user of 512 bytes, transposed datasets with MATLAB_class, sparse ones as groups."""
    path = HERE / "v73.mat"
    with h5py.File(path, "w", userblock_size=512, libver="earliest") as file:
        def dense(group, name, matrix, kind=b"double"):
            data = group.create_dataset(name, data=matrix.T, chunks=True, compression="gzip", compression_opts=3)
            data.attrs["MATLAB_class"] = np.bytes_(kind)

        def sparse(group, name, matrix):
            matrix = sp.csc_matrix(matrix)
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_(b"double")
            inner.attrs["MATLAB_sparse"] = np.uint64(matrix.shape[0])
            if matrix.nnz:
                inner["data"] = matrix.data
                inner["ir"] = matrix.indices.astype(np.uint64)
            inner["jc"] = matrix.indptr.astype(np.uint64)

        sparse(file, "K", STIFFNESS)
        sparse(file, "G", GENERAL)
        sparse(file, "nothing", np.zeros((3, 3)))
        dense(file, "M", MASS)
        dense(file, "Gd", GENERAL)
        dense(file, "bytes", WHOLE.astype(np.uint8), b"uint8")
        text = file.create_dataset("label", data=np.frombuffer(b"abc", np.uint8).astype(np.uint16)[:, None])
        text.attrs["MATLAB_class"] = np.bytes_(b"char")
        z = np.zeros((1, 1), dtype=[("real", "<f8"), ("imag", "<f8")])
        file.create_dataset("z", data=z).attrs["MATLAB_class"] = np.bytes_(b"double")
        model = file.create_group("model")
        model.attrs["MATLAB_class"] = np.bytes_(b"struct")
        dense(model, "M", MASS)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sat Nov 21 00:00:00 2026 HDF5 schema 1.00 ."
    with open(path, "r+b") as file:
        file.write(head.ljust(116) + b"\0" * 8 + b"\0\2IM")
    with h5py.File(HERE / "plain.h5", "w", libver=("v110", "v110")) as file:
        file["K"] = STIFFNESS
        file.create_dataset("sub/G", data=GENERAL, chunks=(2, 3), compression="gzip", shuffle=True)


def octave():
    """Octave 7.3 loads what SciPy wrote and saves it again; it stores doubles that are whole numbers in smaller types."""
    code = "load('v5.mat'); whole = double(bytes); {}"
    save = "save('-v7', 'octave_v7.mat', 'K', 'M', 'G', 'whole', 'model'); save('-v6', 'octave_v6.mat', 'K', 'M', 'G', 'whole', 'model');"
    # Octave stores HDF5 in a form of its own, transposed and without saying so, which is refused.
    save += "save('-hdf5', 'octave.h5', 'G', 'whole'); W = K; save('-hdf5', '-append', 'octave.h5', 'W');"
    subprocess.run(["octave-cli", "--no-gui", "--eval", code.format(save)], cwd=HERE, capture_output=True, check=False)
    with h5py.File(HERE / "octave.h5", "a") as file:
        file["plain"] = STIFFNESS


# Grid points and components of the rows.
NODES = [(7, 1), (7, 2), (9, 1), (10, 3), (100, 1), (100, 6)]


def ten_digits(matrix):
    return np.vectorize(lambda x: float(f"{x:.9e}"))(matrix)


def output2(path, order, whole, matrices):
    """Writes OUTPUT2 with a label, a table and these matrices, whose columns are strings of numbers; pyyeti reads it back."""
    integers = lambda *values: struct.pack(f"{order}{len(values)}{'i' if whole == 4 else 'q'}", *values)
    text = lambda value: value.ljust(2 * whole).encode()
    with open(path, "wb") as file:

        def record(data):
            length = struct.pack(f"{order}i", len(data))
            file.write(length + data + length)

        def keys(*values):
            for value in values:
                record(integers(value))

        def head(data):
            keys(len(data) // whole)
            record(data)

        def block(name, trailer, kind):
            head(text(name))
            keys(-1)
            head(integers(*trailer))
            keys(-2, 1, 0)
            head(text(name) + (integers(170, 170) if kind else b""))
            keys(-3, 1, kind)

        head(integers(11, 28, 26))
        head(b"NASTRAN FORT TAPE ID CODE - ".ljust(7 * whole))
        head(text("NX8.5"))
        keys(-1, 0)
        block("GEOM1", [101, 0, 0, 0, 0, 0, 0], 0)
        head(integers(7, 1, 2, 3))
        keys(-4, 1, 0, 0)
        for name, matrix in matrices.items():
            rows, columns = matrix.shape
            block(name, [102, columns, rows, 6 if rows == columns else 2, 2, 2 * rows, 0], 1)
            for column in range(columns):
                values = matrix[:, column]
                begins = [i for i in range(rows) if values[i] != 0 and (i == 0 or values[i - 1] == 0)]
                for begin in begins:
                    end = next((i for i in range(begin, rows) if values[i] == 0), rows)
                    numbers = struct.pack(f"{order}{end - begin}d", *values[begin:end])
                    head(integers(begin + 1) + numbers)
                keys(-4 - column, 1, 1 if column + 1 < columns else 0)
            keys(0)
        keys(0)
    with op2.OP2(path) as written:
        back = written.rdop2mats()
    assert all(np.array_equal(back[name][0], matrix) for name, matrix in matrices.items())


def nastran():
    names, matrices = ["kaa", "maa", "gen"], [STIFFNESS, np.where(abs(MASS) < 1e-300, 0, MASS), GENERAL]
    for sparse in ["dense", "bigmat", "nonbigmat"]:
        op4.write(HERE / f"{sparse}_text.op4", names, matrices, binary=False, digits=16, sparse=sparse)
        op4.write(HERE / f"{sparse}_little.op4", names, matrices, binary=True, endian="<", sparse=sparse)
    op4.write(HERE / "bigmat_big_endian.op4", names, matrices, binary=True, endian=">", sparse="bigmat")

    for file, order, whole in [("output2.op2", "<", 4), ("output2_64bit_big.op2", ">", 8)]:
        output2(HERE / file, order, whole, dict(zip(["KAA", "MAA", "GEN"], matrices)))

    # Symmetric; square; rectangular, whose columns are numbers. A punch file has no row of zeros, and no word of it.
    rows = pd.MultiIndex.from_tuples(NODES, names=["id", "dof"])
    tilted = np.tril(STIFFNESS) + np.triu(STIFFNESS, 1) / 3
    cards = {"KAAX": pd.DataFrame(STIFFNESS, rows, rows), "MAAX": pd.DataFrame(MASS, rows, rows),
             "BAAX": pd.DataFrame(tilted, rows, rows), "PAX": pd.DataFrame(GENERAL, rows[:4], [1, 2, 3])}
    with open(HERE / "pyyeti.pch", "w") as file:
        wtdmig(file, cards)
    left = [0, 1, 3, 4, 5]
    expect("punch_mass", ten_digits(MASS[np.ix_(left, left)]))
    expect("punch_tilted", ten_digits(tilted))
    expect("punch_rectangular", ten_digits(GENERAL[[0, 1, 3]]))


BRICKS = """*NODE,NSET=NALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
9,0,.2,2
10,1,0,2
11,1,1,2
12,0,1,2
*ELEMENT,TYPE=C3D8,ELSET=EALL
1,1,2,3,4,5,6,7,8
2,5,6,7,8,9,10,11,12
*MATERIAL,NAME=STEEL
*ELASTIC
210000.,.3
*DENSITY
7.8E-9
*SOLID SECTION,ELSET=EALL,MATERIAL=STEEL
*BOUNDARY
1,1,3
2,2,3
4,3
"""
FREQUENCY = "*STEP\n*FREQUENCY,SOLVER=MATRIXSTORAGE\n4\n*END STEP\n"
SUBSTRUCTURE = """*STEP
*SUBSTRUCTURE GENERATE
*RETAINED NODAL DOFS
2,1
9,1,3
10,2
12,1,3
*SUBSTRUCTURE MATRIX OUTPUT,FILE NAME=substructure,STIFFNESS=YES
*END STEP
"""


def calculix():
    """CalculiX 2.20 writes them; expected values are its text read by NumPy, made symmetric."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        (folder / "bricks.inp").write_text(BRICKS + FREQUENCY)
        (folder / "sub.inp").write_text(BRICKS + SUBSTRUCTURE)
        for job in ["bricks", "sub"]:
            # CalculiX ends with a status other than 0 when it has stored its matrices.
            subprocess.run(["ccx", job], cwd=folder, capture_output=True, check=False)
        for name in ["bricks.sti", "bricks.mas", "bricks.dof", "substructure.mtx"]:
            shutil.copy(folder / name, HERE / name)
    for name in ["bricks.sti", "bricks.mas"]:
        row, column, value = np.loadtxt(HERE / name).T
        rows, columns = row.astype(int) - 1, column.astype(int) - 1
        upper = sp.coo_matrix((value, (rows, columns))).toarray()
        expect(name, upper + np.triu(upper, 1).T)
    text = (HERE / "substructure.mtx").read_text().split("STIFFNESS")[-1]
    values = [float(word) for line in text.splitlines()[1:] if not line.startswith("*") for word in line.split(",") if word.strip()]
    size = int((2 * len(values)) ** 0.5)
    lower = np.zeros((size, size))
    lower[np.tril_indices(size)] = values
    expect("substructure", lower + np.tril(lower, -1).T)


def fortran(value, digits, width, letter="E"):
    return f"{value:{width}.{digits}E}".replace("E", letter)


def by_the_letter():
    """Abaqus, Nastran DMIG and HBMAT, from their documentation; numbers are those that their digits hold."""
    size, nodes = range(N), NODES
    coordinate = "".join(f"{i + 1:8} {j + 1:8} {STIFFNESS[i, j]: .15e}\n" for i in size for j in size if STIFFNESS[i, j])
    (HERE / "abaqus_coordinate.mtx").write_text(coordinate)
    line = lambda i, j: "%d,%d, %d,%d, %.15e\n" % (*nodes[i], *nodes[j], STIFFNESS[i, j])
    (HERE / "abaqus_input.mtx").write_text("".join(line(i, j) for i in size for j in range(i + 1) if STIFFNESS[i, j]))
    rounded = np.vectorize(lambda x: float(f"{x:.15e}"))(STIFFNESS)
    expect("abaqus", rounded)

    cards = ["$TITLE   = BLADE", f"DMIG    {'KAAX':8}{0:8}{6:8}{2:8}{0:8}{'':8}{'':8}{N:8}"]
    for j in size:
        cards.append(f"{'DMIG*':8}{'KAAX':16}{nodes[j][0]:16}{nodes[j][1]:16}{'':16}")
        cards += [f"{'*':8}{nodes[i][0]:16}{nodes[i][1]:16}{fortran(STIFFNESS[i, j], 9, 16, 'D')}"
                  for i in range(j, N) if STIFFNESS[i, j]]
    (HERE / "punch.pch").write_text("\n".join(cards) + "\n")
    expect("punch", ten_digits(STIFFNESS))

    lower = sp.csc_matrix(np.tril(STIFFNESS))
    def block(values, text, per):
        words = [text(value) for value in values]
        return ["".join(words[at:at + per]) for at in range(0, len(words), per)]
    parts = [block(lower.indptr + 1, lambda x: f"{x:10}", 8), block(lower.indices + 1, lambda x: f"{x:10}", 8),
             block(lower.data, lambda x: fortran(x, 16, 25, "D"), 3)]
    counts = [len(part) for part in parts]
    lines = [f"{'Stiffness matrix':72}{'KMAT':8}", "".join(f"{x:14}" for x in [sum(counts), *counts, 1]),
             f"RSA           {N:14}{N:14}{lower.nnz:14}{0:14}", f"{'(8I10)':16}{'(8I10)':16}{'(3D25.16)':20}{'(3D25.16)':20}",
             f"F             {1:14}{0:14}", *sum(parts, []), fortran(0.0, 16, 25, "D")]
    (HERE / "hbmat.matrix").write_text("\n".join(lines) + "\n")
    (HERE / "hbmat.mapping").write_text("  Matrix Eqn      Node      DOF\n" + "".join(
        f"{i + 1:12}{node:10}      {'UX UY UZ ROTX ROTY ROTZ'.split()[dof - 1]}\n" for i, (node, dof) in enumerate(nodes)))


def ansys_full():
    """Records as the Programmer's Reference describes them; the second equation is constrained."""
    words = []

    def record(flags, data):
        start = len(words)
        words.extend([len(data) // 4, flags, *struct.unpack(f"<{len(data) // 4}I", data), 0])
        return start

    integers = lambda values: record(1 << 31, struct.pack(f"<{len(values)}i", *values))
    reals = lambda values: record(0, struct.pack(f"<{len(values)}d", *values))

    def matrix(values):
        """Every row with its columns from the diagonal on, the diagonal last."""
        starts = []
        for i in range(N):
            columns = [j for j in range(i + 1, N) if values[i, j]] + [i]
            starts.append(integers([j + 1 for j in columns]))
            reals([values[i, j] for j in columns])
        return starts[0]

    integers([4] + [0] * 99)
    integers([0] * 160)
    integers([1, 2, 3])
    integers([9, 4])
    header = [0] * 160
    header[0:5] = [-4, N, N - 1, 2, 2]
    header[18], header[26] = matrix(STIFFNESS), matrix(MASS)
    header[35] = integers([3, 3])
    integers([1, -2, 3, 1, 2, 3])
    words[105:265] = struct.unpack("<160I", struct.pack("<160i", *header))
    (HERE / "by_the_letter.full").write_bytes(struct.pack(f"<{len(words)}I", *words))
    left = [0, 2, 3, 4, 5]
    expect("full_stiffness", STIFFNESS[np.ix_(left, left)])
    expect("full_mass", MASS[np.ix_(left, left)])


def main():
    expect("stiffness", STIFFNESS)
    expect("mass", MASS)
    expect("general", GENERAL)
    expect("whole", WHOLE)
    numpy_and_scipy()
    matlab_73()
    octave()
    nastran()
    calculix()
    by_the_letter()
    ansys_full()


main()
