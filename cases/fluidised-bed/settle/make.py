#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Makes ../bed.data: 9240 spheres dropped into the column and left to settle by LIGGGHTS (settle.in).

  ./make.py start > start.data ; liggghts -in settle.in ; ./make.py finish settled.txt > ../bed.data
"""
import random
import sys

WIDTH, DEPTH, D = 0.044, 0.010, 1.2e-3
HEAD = """settled bed of the fluidised-bed case, SI units (made by settle/make.py)

9240 atoms
1 atom types

0 0.044 xlo xhi
0 0.12 ylo yhi
0 0.01 zlo zhi

Atoms

"""


def line(i, x, y, z):
    return f"{i} 1 1.2e-3 1000 {x:.7f} {y:.7f} {z:.7f}".replace(" 0.", " .")


if sys.argv[1] == "start":
    random.seed(1)
    print(HEAD, end="")
    n, step = 0, 1.25e-3
    nx, nz = int(WIDTH / step), int(DEPTH / step)
    while n < 9240:
        layer, rest = divmod(n, nx * nz)
        ix, iz = divmod(rest, nz)
        jitter = lambda: random.uniform(-2e-5, 2e-5)
        n += 1
        print(line(n, (ix + 0.5) * WIDTH / nx + jitter(), (layer + 0.5) * step + jitter(), (iz + 0.5) * DEPTH / nz + jitter()))
else:
    rows = []
    with open(sys.argv[2]) as f:
        for text in f:
            w = text.split()
            if len(w) == 4 and w[0].isdigit():
                rows.append([float(v) for v in w[1:]])
    # numbered from below, row by row: neighbours in the file are neighbours in the bed
    rows.sort(key=lambda r: (round(r[1] / 2.4e-3), round(r[0] / 2.4e-3), r[2]))
    print(HEAD, end="")
    for i, r in enumerate(rows, 1):
        print(line(i, *r))
