#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# headers.sh TARBALL OUT: the headers of LIGGGHTS or LAMMPS from Debian's source package.
set -eu
mkdir -p "$2"
tar xf "$1" -C "$2" --strip-components=2 --wildcards '*/src/*.h'
