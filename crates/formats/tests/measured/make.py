#!/usr/bin/env python3
"""Writes the files of this folder with other programs, and `expected.txt` with their values.

Needs numpy, scipy, h5py, pyuff and pyarrow. Each block of `expected.txt` has the name of a file, then one
line for every column: its name and its values, with as many digits as doubles have.
"""

import decimal
import os
import struct

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyuff
import scipy.io
import scipy.io.wavfile

FOLDER = os.path.dirname(os.path.abspath(__file__))
expected = []


def path(name):
    return os.path.join(FOLDER, name)


def expect(name, **columns):
    lines = [name]
    for column, values in columns.items():
        lines.append(" ".join([column.replace("__", "."), *(repr(float(value)) for value in values)]))
    expected.append("\n".join(lines))


def universal():
    """Functions as text and binary, real and complex, over even and uneven abscissas."""
    rng = np.random.default_rng(1)
    count = 7
    for binary in (0, 1):
        for kind in (2, 4, 5, 6):
            for even in (0, 1):
                x = np.arange(count) * 0.25 + 1 if even else np.sort(rng.random(count)) * 10
                y = rng.standard_normal(count) * 10.0 ** rng.integers(-5, 5, count)
                if kind > 4:
                    y = y + 1j * rng.standard_normal(count)
                name = f"function_{'binary' if binary else 'text'}_{kind}_{'even' if even else 'uneven'}.uff"
                if os.path.exists(path(name)):
                    os.remove(path(name))
                data = dict(type=58, func_type=4, rsp_node=3, rsp_dir=-2, ref_node=1, ref_dir=1, id1="beam", binary=binary, abscissa_spec_data_type=18,
                            ordinate_spec_data_type=12, orddenom_spec_data_type=13,
                            ord_data_type=kind, abscissa_spacing=even, x=x, data=y, num_pts=count,
                            abscissa_inc=0.25 if even else 0, abscissa_min=x[0], z_axis_value=0,
                            abscissa_axis_lab="Frequency", abscissa_axis_units_lab="Hz",
                            ordinate_axis_lab="Acceleration", ordinate_axis_units_lab="m/s^2",
                            orddenom_axis_lab="Force", orddenom_axis_units_lab="N")
                if binary:
                    data.update(byte_ordering=1 + even, fp_format=2, n_ascii_lines=11, n_bytes=0)
                pyuff.UFF(path(name)).write_sets(data, "add", force_double=binary == 1 or kind in (4, 6))
                back = pyuff.UFF(path(name)).read_sets(0)
                if np.iscomplexobj(back["data"]):
                    expect(name, **{"1__x": back["x"], "1__real": back["data"].real, "1__imaginary": back["data"].imag})
                else:
                    expect(name, **{"1__x": back["x"], "1__y": back["data"]})
    name = "geometry.uff"
    if os.path.exists(path(name)):
        os.remove(path(name))
    file = pyuff.UFF(path(name))
    file.write_sets(pyuff.prepare_164(units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0), "add")
    nodes = dict(type=15, node_nums=[1, 2], def_cs=[0, 0], disp_cs=[0, 0], color=[8, 8], x=[0.5, -1.5], y=[-0.25, 2.0], z=[0.0, 1.0])
    file.write_sets(nodes, "add")
    expect(name, **{"2__node": [1, 2], "2__x": [0.5, -1.5], "2__y": [-0.25, 2.0], "2__z": [0.0, 1.0]})


def arrays():
    t = np.arange(5) * 0.1
    matrix = np.arange(6.0).reshape(3, 2)
    runs = np.array([(t, t**2, "first"), (t + 1, np.exp(1j * t), "")], dtype=[(field, "O") for field in ("t", "F", "title")])
    cells = np.array([t, "word"], dtype=object)
    for name, packed in (("packed.mat", True), ("plain.mat", False)):
        scipy.io.savemat(path(name), {"run": runs, "one": {"deep": {"x": matrix}}, "cells": cells,
                                      "count": np.arange(5, dtype="uint8"), "wide": matrix.T}, do_compression=packed)
        expect(name, **{"run(1)__t": t, "run(1)__F": t**2, "run(2)__t": t + 1, "run(2)__F_real": np.cos(t),
                        "run(2)__F_imaginary": np.sin(t), "one__deep__x_1": matrix[:, 0], "one__deep__x_2": matrix[:, 1],
                        "cells{1}": t, "count": np.arange(5), "wide_1": matrix[:, 0], "wide_2": matrix[:, 1]})
    content = dict(t=t, c=t + 1j * t**2, f=np.asfortranarray(matrix), i=np.arange(5, dtype=">i4"))
    for name, save in (("plain.npz", np.savez), ("packed.npz", np.savez_compressed)):
        save(path(name), **content)
        expect(name, t=t, c_real=t, c_imaginary=t**2, f_1=matrix[:, 0], f_2=matrix[:, 1], i=np.arange(5))
    np.save(path("array.npy"), matrix)
    expect("array.npy", values_1=matrix[:, 0], values_2=matrix[:, 1])
    with h5py.File(path("groups.h5"), "w") as file:
        file["rig/t"] = t
        file["rig/m"] = matrix
    expect("groups.h5", rig__m_1=matrix[:, 0], rig__m_2=matrix[:, 1], rig__t=t)
    samples = np.array([[0, 1], [16384, -32768], [-1, 32767]], dtype="int16")
    scipy.io.wavfile.write(path("sound.wav"), 8000, samples)
    expect("sound.wav", time=np.arange(3) / 8000, channel_1=samples[:, 0] / 32768, channel_2=samples[:, 1] / 32768)


def text():
    with open(path("germany.csv"), "wb") as file:
        file.write("Prüfstand 3\r\nZeit [s];Kraft [kN];Weg (µm)\r\n0,0;1,5;-2\r\n0,1;-1,25e-3;3,75\r\n0,2;2;".encode("latin-1"))
    expect("germany.csv", Zeit=[0, 0.1], Kraft=[1.5, -1.25e-3], Weg=[-2, 3.75])
    np.savetxt(path("savetxt.txt"), [[0.0, 1.0], [0.5, -2.0]], header="time_s force_N")
    expect("savetxt.txt", time_s=[0, 0.5], force_N=[1, -2])


def parquet():
    """Tables of pyarrow: every encoding and compression of numbers, nulls, structures."""
    rng = np.random.default_rng(4)
    count = 40
    force = np.round(rng.standard_normal(count), 3)
    columns = dict(
        time=np.arange(count) * 0.125,
        force=force,
        level=np.repeat(np.arange(5), 8) * 1.5,
        single=force.astype(np.float32),
        number=(np.arange(count) - 7).astype(np.int32) * 3,
        large=rng.integers(0, 2**63, count).astype(np.uint64) * 2,
        flag=force > 0,
    )
    table = pa.table({**columns, "title": [f"run {i // 8}" for i in range(count)]})
    gaps = pa.array([None if i % 5 == 1 else float(value) for i, value in enumerate(force)])
    table = table.append_column("gaps", gaps)
    table = table.append_column("load", pa.StructArray.from_arrays([gaps, pa.array(force * 2)], ["x", "y"]))
    table = table.append_column("list", pa.array([[1.0]] * count))
    table = table.append_column("day", pa.array(np.arange(count), pa.timestamp("us")))
    table = table.append_column("price", pa.array([decimal.Decimal(i) / 4 for i in range(count)], pa.decimal128(6, 2)))
    values = {**columns, "gaps": gaps.to_numpy(zero_copy_only=False), "load__x": gaps.to_numpy(zero_copy_only=False), "load__y": force * 2}
    split = dict.fromkeys(["time", "force", "single"], "BYTE_STREAM_SPLIT") | {"number": "DELTA_BINARY_PACKED", "flag": "RLE"}
    for name, options in dict(
        snappy=dict(compression="snappy", row_group_size=16),
        gzip=dict(compression="gzip", data_page_version="2.0", store_decimal_as_integer=True),
        zstd=dict(compression="zstd", use_dictionary=False, data_page_size=100),
        plain=dict(compression="none", use_dictionary=False, column_encoding=split, data_page_version="2.0"),
    ).items():
        pq.write_table(table, path(f"{name}.parquet"), **options)
        decimals = {"price": np.arange(count) / 4} if name == "gzip" else {}
        expect(f"{name}.parquet", **values, **decimals)


universal()
arrays()
text()
parquet()
with open(path("expected.txt"), "w") as file:
    file.write("\n\n".join(expected) + "\n")
