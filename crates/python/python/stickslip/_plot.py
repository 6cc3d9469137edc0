"""Figures with matplotlib."""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np


def plot(figure: dict[str, Any], axes: Any = None) -> Any:
    """Draws the figure of a result, one axes object per panel. Returns matplotlib's ``Figure``."""
    plt = importlib.import_module("matplotlib.pyplot")
    panels = figure["panels"]
    if axes is None:
        columns = max(1, math.ceil(math.sqrt(len(panels))))
        rows = max(1, math.ceil(len(panels) / columns))
        drawing, grid = plt.subplots(rows, columns, squeeze=False, figsize=(5 * columns, 3.6 * rows), layout="constrained")
        axes = list(grid.flat)
        for spare in axes[len(panels) :]:
            spare.set_axis_off()
        drawing.suptitle(figure["title"])
    else:
        axes = list(np.ravel(axes))
        if len(axes) < len(panels):
            raise ValueError(f"the figure has {len(panels)} panels, but {len(axes)} axes were given")
        drawing = axes[0].figure if axes else plt.figure()
    for panel, pair in zip(panels, axes):
        _panel(panel, pair)
    return drawing


def _panel(panel: dict[str, Any], axes: Any) -> None:
    labels: set[str] = set()
    for series in panel["series"]:
        # NaN interrupts a curve
        x, y, base = ([math.nan if value is None else value for value in series[key]] for key in ("x", "y", "base"))
        label = series["label"] if series["label"] not in labels else ""
        labels.add(label)
        style = {"color": f"C{series['colour'] % 10}", "label": label or "_"}
        if series["emphasis"] == "Pale":
            style |= {"alpha": 0.4, "linewidth": 0.8}
        elif series["emphasis"] == "Reference":
            style |= {"color": "0.5", "linestyle": "--", "zorder": 1}
        kind = series["style"]
        if kind == "Marks":
            axes.plot(x, y, "o", **{key: value for key, value in style.items() if key != "linestyle"})
        elif kind == "Band":
            axes.fill_between(x, base or 0, y, alpha=0.3, color=style["color"], label=style["label"])
        elif kind == "Bars":
            axes.bar(x, y, bottom=base or None, color=style["color"], label=style["label"])
        else:
            lines = {"Solid": "-", "Dashed": "--", "Dotted": ":"}
            axes.plot(x, y, **{"linestyle": lines[kind], **style})
    for axis, name in ((panel["x"], "x"), (panel["y"], "y")):
        unit = f" ({axis['unit']})" if axis["unit"] else ""
        getattr(axes, f"set_{name}label")(axis["quantity"] + unit)
        if axis["scale"] == "Log":
            getattr(axes, f"set_{name}scale")("log")
        if axis["range"]:
            getattr(axes, f"set_{name}lim")(*axis["range"])
    axes.set_title(panel["title"])
    if labels - {""} and len(labels) <= 12:
        axes.legend()
