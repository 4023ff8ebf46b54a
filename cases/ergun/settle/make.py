#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Makes ../random/bed.data from what settle.in leaves: 10 000 spheres at rest in a cylinder.

  liggghts -in settle.in ; ./make.py bed.dump > ../random/bed.data
"""
import sys

rows = []
with open(sys.argv[1]) as f:
    for words in map(str.split, f):
        if len(words) == 4 and words[0].isdigit():
            rows.append(tuple(float(w) for w in words[1:]))
if len(rows) != 10000:
    sys.exit(f"{sys.argv[1]} has {len(rows)} spheres; settle.in makes 10000: did LIGGGHTS insert them all?")
# numbered from below, row by row: neighbours in the file are neighbours in the bed
rows.sort(key=lambda r: (round(r[2] / 2e-3), round(r[1] / 2e-3), r[0]))
print("""poured bed of the ergun case, part (b), SI units (settle/settle.in, settle/make.py)

10000 atoms
1 atom types

-0.014 0.014 xlo xhi
-0.014 0.014 ylo yhi
0 0.032 zlo zhi

Atoms
""")
for i, r in enumerate(rows, 1):
    print(f"{i} 1 1e-3 2000", *(f"{x:.6f}".replace("0.", ".", 1) for x in r))
