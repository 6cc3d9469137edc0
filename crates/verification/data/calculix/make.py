"""Makes the data of this folder with CalculiX (Debian: calculix-ccx): python3 make.py

Meshes a blade and the sector of a bladed disk, writes the decks, runs `ccx`, and keeps matrices (gzip), frequencies and responses.
Units: mm, t, s. No library is needed.
"""
import gzip, math, os, re, shutil, subprocess, tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
STEEL = "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85E-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n"
ALPHA, BETA = 5.0, 1e-7  # Rayleigh damping, 1/s and s
MODES = 400  # of the sum that a response is


def lines(numbers, per=10):
    numbers = [str(n) for n in numbers]
    return "".join(", ".join(numbers[i:i + per]) + "\n" for i in range(0, len(numbers), per))


class Mesh:
    def __init__(self):
        self.nodes, self.number, self.elements, self.sets = {}, {}, [], {}

    def node(self, key, xyz):
        if key not in self.number:
            self.number[key] = len(self.number) + 1
            self.nodes[self.number[key]] = xyz
        return self.number[key]

    def box(self, ranges, place):
        """Hexahedra over a grid; `place` takes grid indices to coordinates."""
        (i0, i1), (j0, j1), (k0, k1) = ranges
        for i in range(i0, i1):
            for j in range(j0, j1):
                for k in range(k0, k1):
                    corners = [(i, j, k), (i + 1, j, k), (i + 1, j + 1, k), (i, j + 1, k)]
                    corners += [(a, b, c + 1) for a, b, c in corners]
                    self.elements.append([self.node(at, place(*at)) for at in corners])

    def deck(self, sets, held, element="C3D8"):
        text = "*NODE, NSET=NALL\n"
        text += "".join(f"{n}, {x:.15g}, {y:.15g}, {z:.15g}\n" for n, (x, y, z) in self.nodes.items())
        text += f"*ELEMENT, TYPE={element}, ELSET=ALL\n"
        text += "".join(f"{e + 1}, " + ", ".join(map(str, nodes)) + "\n" for e, nodes in enumerate(self.elements))
        for name, nodes in sets.items():
            text += f"*NSET, NSET={name}\n" + lines(nodes)
        return text + STEEL + f"*BOUNDARY\n{held}, 1, 3\n"


def run(folder, name, deck):
    with open(os.path.join(folder, name + ".inp"), "w") as file:
        file.write(deck)
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    log = subprocess.run(["ccx", name], cwd=folder, env=environment, capture_output=True, text=True)
    if "ERROR" in log.stdout:
        raise SystemExit(log.stdout[-3000:])
    path = os.path.join(folder, name + ".dat")
    return open(path).read() if os.path.exists(path) else ""


def keep_matrices(folder, name):
    for ending in ("sti", "mas"):
        source = os.path.join(folder, f"{name}.{ending}")
        with open(source, "rb") as file, open(os.path.join(HERE, f"{name}.{ending}.gz"), "wb") as out:
            with gzip.GzipFile("", "wb", 9, out, mtime=0) as packed:
                shutil.copyfileobj(file, packed)
    shutil.copy(os.path.join(folder, name + ".dof"), os.path.join(HERE, name + ".dof"))


def keep(name, text):
    with open(os.path.join(HERE, name), "w") as file:
        file.write(text)


def frequencies(dat):
    """Hz, of every table of eigenvalues: mode number, eigenvalue, rad/s, cycles/s, imaginary part."""
    return [float(m.group(1)) for m in re.finditer(r"^ +\d+ +\S+ +\S+ +(\S+) +\S+ *$", dat, re.M)]


MATRICES = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n10\n*END STEP\n"


def blade(folder):
    nx, ny, nz = 24, 8, 3
    mesh = Mesh()
    # 100 mm long, tapered from 30 mm to 20 mm, twisted by 30 degrees
    def place(i, j, k):
        x, y, z = 100 * i / nx, (j / ny - 0.5) * (30 - 10 * i / nx), (k / nz - 0.5) * 4
        turn = math.radians(30) * i / nx
        return x, y * math.cos(turn) - z * math.sin(turn), y * math.sin(turn) + z * math.cos(turn)
    mesh.box(((0, nx), (0, ny), (0, nz)), place)
    at = mesh.number
    root = [n for (i, _, _), n in at.items() if i == 0]
    tip = at[(nx, ny, nz)]
    # the middle, the other corner of the tip, both edges between, the foot
    seen = [(nx // 2, ny // 2, 0), (nx, 0, 0), (3 * nx // 4, 0, nz), (3 * nx // 4, ny, 0), (nx // 4, ny // 2, nz)]
    seen = [at[corner] for corner in seen] + [tip]
    deck = mesh.deck({"ROOT": root} | {f"SEEN{node}": [node] for node in seen}, "ROOT")
    run(folder, "blade", deck + MATRICES)
    keep_matrices(folder, "blade")
    dat = run(folder, "frequencies", deck + "*STEP\n*FREQUENCY\n20\n*END STEP\n")
    own = frequencies(dat)
    keep("blade_frequencies_Hz.txt", "".join(f"{f:.9g}\n" for f in own[:20]))
    rows = "frequency_Hz,node,ux_re,uy_re,uz_re,ux_im,uy_im,uz_im\n"
    for hertz in (0.98 * own[0], 1.005 * own[0], 0.99 * own[1], 1.01 * own[1], 0.995 * own[2], 1.02 * own[2]):
        hertz = float(f"{hertz:.5g}")
        dat = run(folder, "response", deck + f"*STEP\n*FREQUENCY, STORAGE=YES\n{MODES}\n*END STEP\n"
                  f"*STEP\n*STEADY STATE DYNAMICS\n{hertz}, {hertz * 1.0001:.9g}, 2, 1.\n"
                  f"*MODAL DAMPING, RAYLEIGH\n,, {ALPHA}, {BETA}\n*CLOAD\n{tip}, 3, 1.\n"
                  + "".join(f"*NODE PRINT, NSET=SEEN{node}\nU\n" for node in seen) + "*END STEP\n")
        found = {}
        for header, node, *u in re.findall(
                r"displacements (.*?)\n\s*\n +(\d+) +(\S+) +(\S+) +(\S+)", dat):
            found.setdefault(int(node), []).append(u)
        for node, tables in found.items():
            rows += f"{hertz:.9g},{node}," + ",".join(tables[0] + tables[1]) + "\n"
    keep("blade_response.csv", rows)


def sector(folder):
    count, nr, nc, nz, nb = 12, 9, 9, 4, 12
    inner, rim, height = 40.0, 90.0, 12.0
    mesh = Mesh()
    def place(i, j, k):
        angle = math.radians(360 / count) * (j / nc - 0.5)
        z = height * (k / nz - 0.5)
        if i <= nr:
            r = inner + (rim - inner) * i / nr
            return r * math.cos(angle), r * math.sin(angle), z
        # the blade is straight
        return rim * math.cos(angle) + 60 * (i - nr) / nb, rim * math.sin(angle) + 0.8 * (i - nr) / nb * k / nz, z
    mesh.box(((0, nr), (0, nc), (0, nz)), place)
    mesh.box(((nr, nr + nb), (nc // 3, 2 * nc // 3), (0, nz)), place)
    at = mesh.number
    pick = lambda test: [n for key, n in sorted(at.items()) if test(*key)]
    bore = pick(lambda i, j, k: i == 0)
    right, left = pick(lambda i, j, k: j == 0 and i > 0), pick(lambda i, j, k: j == nc and i > 0)
    deck = mesh.deck({"BORE": bore, "RIGHT": right, "LEFT": left}, "BORE")
    run(folder, "sector", deck + MATRICES)
    keep_matrices(folder, "sector")
    keep("sector_boundary.csv", "low,high\n" + "".join(f"{a},{b}\n" for a, b in zip(right, left)))
    keep("sector_nodes.csv", "node,x,y,z\n" + "".join(f"{n},{x:.15g},{y:.15g},{z:.15g}\n" for n, (x, y, z) in mesh.nodes.items()))
    cyclic = ("*SURFACE, TYPE=NODE, NAME=SLEFT\nLEFT\n*SURFACE, TYPE=NODE, NAME=SRIGHT\nRIGHT\n"
              "*TIE, NAME=T1, CYCLIC SYMMETRY\nSLEFT, SRIGHT\n"
              f"*CYCLIC SYMMETRY MODEL, N={count}, NGRAPH=1, TIE=T1, ELSET=ALL\n0., 0., 0., 0., 0., 1.\n")
    table = "nodal_diameter,mode,frequency_Hz\n"
    for diameter in range(count // 2 + 1):
        dat = run(folder, "cyclic", deck + cyclic + "*STEP\n*FREQUENCY\n8\n"
                  f"*SELECT CYCLIC SYMMETRY MODES, NMIN={diameter}, NMAX={diameter}\n*END STEP\n")
        found = [float(m.group(1)) for m in re.finditer(r"^ +\d+ +\d+ +\S+ +\S+ +(\S+) +\S+ *$", dat, re.M)]
        for mode, hertz in enumerate(found[:8]):
            table += f"{diameter},{mode + 1},{hertz:.9g}\n"
    keep("sector_frequencies.csv", table)


def incompatible(folder):
    """A strip of elements with incompatible modes, whose inner rows stand behind those of the mesh."""
    mesh = Mesh()
    mesh.box(((0, 6), (0, 2), (0, 1)), lambda i, j, k: (5.0 * i, 3.0 * j, 1.0 * k))
    root = [n for (i, _, _), n in mesh.number.items() if i == 0]
    deck = mesh.deck({"ROOT": root}, "ROOT", "C3D8I")
    run(folder, "incompatible", deck + MATRICES)
    keep_matrices(folder, "incompatible")
    own = frequencies(run(folder, "frequencies", deck + "*STEP\n*FREQUENCY\n6\n*END STEP\n"))
    keep("incompatible_frequencies_Hz.txt", "".join(f"{f:.9g}\n" for f in own[:6]))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        incompatible(folder)
        blade(folder)
        sector(folder)
