#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# headers.sh TARBALL OUT: flat include folders from Debian's source package of OpenFOAM.
# Templates need the .C files too (NoRepository). Only the folders that our sources include are unpacked.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
dirs="OpenFOAM OSspecific/POSIX finiteVolume meshTools surfMesh fileFormats TurbulenceModels transportModels fvOptions sampling dynamicMesh"
set -- "$1" "$2" $(for d in $dirs; do echo "*/src/$d/*"; done)
tarball=$1 out=$2
shift 2
tar xf "$tarball" -C "$work" --strip-components=2 --wildcards "$@"
flat() {
  mkdir -p "$out/$1"
  find "$work/$2" -type d \( -name lnInclude -o -name Make -o -name config -o -name noLink \) -prune -o \
    -type f \( -name '*.H' -o -name '*.C' -o -name '*.h' -o -name '*.hh' -o -name '*.hpp' \) -exec cp -f -t "$out/$1" {} +
}
flat OpenFOAM OpenFOAM
flat OSspecific OSspecific/POSIX
flat turbulenceModels TurbulenceModels/turbulenceModels
flat incompressibleTurbulence TurbulenceModels/incompressible
for d in finiteVolume meshTools surfMesh fileFormats fvOptions sampling dynamicMesh; do flat $d $d; done
mkdir -p "$out/transportModels"
cp -r "$work/transportModels/incompressible" "$out/transportModels/"
