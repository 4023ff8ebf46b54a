# SPDX-License-Identifier: MIT OR Apache-2.0
"""What the checks of the cases share: run a case, read its results, compare numbers, print a table."""
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
VOIDAGE = os.path.join(ROOT, "build", "bin", "voidage")
ALL_RANKS = [(1, 1), (2, 1), (1, 2), (2, 2)]  # (DEM, CFD)
LAMMPS = {"dem.program": "lammps", "dem.script": "lammps.in"}  # settings of a run with LAMMPS; needs ./setup lammps


class Check:
    """Collects measured numbers; `done` prints the verdict and exits."""

    def __init__(self, name):
        self.name, self.failed, self.count = name, 0, 0
        words = sys.argv[1:]
        self.only = words.pop(words.index("--only") + 1) if "--only" in words[:-1] else ""
        self.quick = "--quick" in words
        if set(words) - {"--quick", "--only"} or (not self.only and "--only" in words):
            sys.exit(f"{name}/check: unknown arguments; type: cases/{name}/check [--quick] [--only TEXT], "
                     "TEXT a part of the labels it prints, for example '(2, 1)'")
        if not os.path.exists(VOIDAGE):
            sys.exit(f"{VOIDAGE} is missing; type: ./setup build")
        self.scratch = tempfile.mkdtemp(prefix=f"voidage-{name}-")
        print(f"{'what':58} {'measured':>13} {'expected':>13} {'tolerance':>10}")

    def wants(self, label):
        """False: left out by --only."""
        return self.only in label

    def near(self, what, measured, expected, tolerance):
        """Relative deviation at most `tolerance`."""
        ok = abs(measured - expected) <= tolerance * abs(expected)
        self._row(what, measured, expected, f"{100 * tolerance:.3g} %", ok)

    def below(self, what, measured, limit):
        ok = measured <= limit
        self._row(what, measured, f"<= {limit:.3g}", "", ok)

    def above(self, what, measured, limit):
        ok = measured >= limit
        self._row(what, measured, f">= {limit:.3g}", "", ok)

    def _row(self, what, measured, expected, tolerance, ok):
        self.count += 1
        self.failed += not ok
        expected = expected if isinstance(expected, str) else f"{expected:.6g}"
        print(f"{what:58} {measured:13.6g} {expected:>13} {tolerance:>10} {'ok' if ok else 'FAIL'}", flush=True)

    def run(self, case, label, ranks=(1, 1), settings=None, edit=None):
        """Runs a copy of the case; `edit(folder)` may change the copy. Returns the folder."""
        folder = os.path.join(self.scratch, re.sub(r"\W+", "-", label))
        shutil.copytree(os.path.join(ROOT, "cases", case), folder + ".case")
        if edit:
            edit(folder + ".case")
        command = [VOIDAGE, "run", folder + ".case", "--into", folder]
        values = {"run.dem_ranks": ranks[0], "run.cfd_ranks": ranks[1], **(settings or {})}
        for key, value in values.items():
            command += ["--set", f"{key}={value}"]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            print(done.stdout)
            sys.exit(f"{self.name}/check: the run '{label}' failed; it is kept in {folder}")
        shutil.rmtree(folder + ".case")
        return folder

    def books(self, folder, label):
        """Design 3.1: third law and solid volume in every row of the monitor."""
        rows = monitor(folder)
        errors = [float(r["action_reaction_error"]) for r in rows if r["action_reaction_error"]]
        if errors:
            self.below(f"{label}: action-reaction error, worst step", max(errors), 1e-12)
        self.below(f"{label}: solid volume error, worst step", max(float(r["solid_volume_error"]) for r in rows), 1e-12)

    def done(self):
        shutil.rmtree(self.scratch, ignore_errors=True)
        if not self.count:
            sys.exit(f"{self.name}/check: no label has '{self.only}'")
        print(f"{self.name}: {self.count - self.failed} of {self.count} numbers within tolerance")
        sys.exit(1 if self.failed else 0)


def monitor(folder):
    with open(os.path.join(folder, "monitor.csv")) as f:
        return list(csv.DictReader(f))


def log(folder, name):
    with open(os.path.join(folder, "logs", name + ".log"), errors="replace") as f:
        return f.read()


def thermo(folder, columns):
    """Rows of the DEM's thermo output with that many columns."""
    rows = []
    for line in log(folder, "dem").splitlines():
        words = line.split()
        if len(words) == columns:
            try:
                rows.append([float(w) for w in words])
            except ValueError:
                pass
    return rows


def replace(folder, path, old, new):
    """Edits a file of a copied case; the text must be there."""
    path = os.path.join(folder, path)
    with open(path) as f:
        text = f.read()
    if old not in text:
        sys.exit(f"{path}: '{old}' not found")
    with open(path, "w") as f:
        f.write(text.replace(old, new))


def foam_field(path):
    """Values of an ascii volField's internalField (list of floats or tuples); uniform fields give one value."""
    with open(path) as f:
        text = f.read()
    body = text[text.index("internalField"):text.index("boundaryField")]
    number = r"[-+.\deE]+"
    uniform = re.match(r"internalField\s+uniform\s+([^;]+);", body)
    body = uniform.group(1) if uniform else body[body.index("(") + 1:]
    vectors = re.findall(rf"\(\s*({number})\s+({number})\s+({number})\s*\)", body)
    if vectors:
        return [tuple(float(x) for x in v) for v in vectors]
    return [float(x) for x in re.findall(number, body.replace(")", " ").replace(";", " ").replace("(", " "))]


def _list(path):
    """Text between the outer brackets of an ascii OpenFOAM list file, without its header and comments."""
    with open(path) as f:
        text = re.sub(r"//[^\n]*|/\*.*?\*/", "", f.read(), flags=re.S)
    text = text[text.index("}") + 1:]
    return text[text.index("(") + 1:text.rindex(")")]


def cells(mesh):
    """[(centre, volume)] of the cells of an ascii polyMesh folder, m and m3; sums of pyramids over the faces."""
    points = [tuple(float(x) for x in p.split()) for p in re.findall(r"\(([^()]+)\)", _list(f"{mesh}/points"))]
    faces = [[int(i) for i in f.split()] for f in re.findall(r"\(([^()]+)\)", _list(f"{mesh}/faces"))]
    owner, neighbour = ([int(i) for i in _list(f"{mesh}/{name}").split()] for name in ("owner", "neighbour"))
    n = max(owner + neighbour) + 1
    sides = [[] for _ in range(n)]
    for i, face in enumerate(faces):
        sides[owner[i]].append((face, 1))
        if i < len(neighbour):
            sides[neighbour[i]].append((face, -1))
    result = []
    for side in sides:
        corners = [points[p] for face, _ in side for p in face]
        apex = [sum(p[a] for p in corners) / len(corners) for a in range(3)]
        volume, moment = 0.0, [0.0] * 3
        for face, sign in side:
            x = [points[p] for p in face]
            mid = [sum(p[a] for p in x) / len(x) for a in range(3)]
            for p, q in zip(x, x[1:] + x[:1]):
                # tetrahedron apex, mid, p, q
                u, v, w = ([c[a] - apex[a] for a in range(3)] for c in (mid, p, q))
                tetra = sign / 6 * (u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2])
                                    + u[2] * (v[0] * w[1] - v[1] * w[0]))
                volume += tetra
                for a in range(3):
                    moment[a] += tetra * (apex[a] + mid[a] + p[a] + q[a]) / 4
        result.append((tuple(m / volume for m in moment), volume))
    return result


def fields(folder, names, cfd_ranks=1, time=None):
    """One row per cell: (centre, volume, value of each named ascii field), at `time` (text) or the last time.

    Reads the processor folders when the run was decomposed; the rows of all ranks follow one another."""
    fluid, rows = os.path.join(folder, "fluid"), []
    for part in [fluid] if cfd_ranks == 1 else [os.path.join(fluid, f"processor{r}") for r in range(cfd_ranks)]:
        times = [t for t in os.listdir(part) if re.fullmatch(r"\d+(\.\d+)?", t) and float(t) > 0]
        at = os.path.join(part, time or max(times, key=float))
        mesh = cells(os.path.join(part, "constant", "polyMesh"))
        values = [foam_field(os.path.join(at, name)) for name in names]
        values = [v * len(mesh) if len(v) == 1 else v for v in values]
        rows += [(c, v, *row) for (c, v), *row in zip(mesh, *values)]
    return rows
