"""Writes blade.inp: a cantilever of 60 mm and a damper on its upper face, with their sets."""


def brick(box, counts, first):
    """Returns the nodes and the elements of 20 nodes of a box (mm)."""
    steps = [(high - low) / (2 * count) for (low, high), count in zip(box, counts)]
    nodes, elements = {}, []

    def node(*at):
        if at not in nodes:
            nodes[at] = first + len(nodes)
        return nodes[at]

    order = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
             (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
             (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)]
    for k in range(counts[2]):
        for j in range(counts[1]):
            for i in range(counts[0]):
                elements.append([node(2 * i + a, 2 * j + b, 2 * k + c) for a, b, c in order])
    position = lambda at: [low + step * n for (low, _), step, n in zip(box, steps, at)]
    return {number: position(at) for at, number in nodes.items()}, elements


blade, blade_elements = brick([(0, 60), (0, 4), (0, 8)], [10, 1, 1], 1)
damper, damper_elements = brick([(36, 48), (0, 4), (8, 12)], [2, 1, 1], 1001)
lines = ["*NODE"]
lines += [f"{number}, {x:g}, {y:g}, {z:g}" for number, (x, y, z) in {**blade, **damper}.items()]
for name, elements, first in [("BLADE", blade_elements, 1), ("DAMPER", damper_elements, 101)]:
    lines.append(f"*ELEMENT, TYPE=C3D20, ELSET={name}")
    for number, element in enumerate(elements, first):
        lines += [f"{number}, " + ", ".join(map(str, element[:10])) + ",", ", ".join(map(str, element[10:]))]
sets = {
    "ROOT": [n for n, at in blade.items() if at[0] == 0],
    "TIP": [n for n, at in blade.items() if at[0] == 60],
    "PADS": [n for n, at in blade.items() if at[2] == 8 and 36 <= at[0] <= 48],
    "DAMPER_FACE": [n for n, at in damper.items() if at[2] == 8],
    "DAMPER_TOP": [n for n, at in damper.items() if at[2] == 12],
}
for name, members in sets.items():
    lines.append(f"*NSET, NSET={name}")
    lines += [", ".join(map(str, members[i : i + 12])) for i in range(0, len(members), 12)]
lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85E-9"]
lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ["BLADE", "DAMPER"]]
lines += ["*BOUNDARY", "ROOT, 1, 3", "DAMPER_TOP, 1, 2"]
open("blade.inp", "w").write("\n".join(lines) + "\n")
