"""Runs the notebooks beside this file from start to end, as a reader would; the first cell that fails ends it with its error."""

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent
for file in [Path(name) for name in sys.argv[1:]] or sorted(HERE.glob("*.ipynb")):
    begin = time.perf_counter()
    notebook = nbformat.read(file, as_version=4)
    # only this run shows the outputs; the files do not store them
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute(cwd=str(HERE))
    printed = [output.text for cell in notebook.cells for output in cell.get("outputs", []) if output.output_type == "stream"]
    print(f"{file.name}: {time.perf_counter() - begin:.1f} s")
    print("".join(printed), end="")
