#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# build.sh PROGRAM HEADERS PREFIX: the fix against Debian's package of PROGRAM (liggghts or lammps), as
# PREFIX/lib/libvoidageLiggghts.so or PREFIX/lib/libvoidageLammps.so.
set -eu
program=$1 headers=$2 prefix=$3
here=$(cd "$(dirname "$0")" && pwd)
case $program in
  liggghts) library=libliggghts.so.3 out=$prefix/lib/libvoidageLiggghts.so ;;
  lammps) library=liblammps.so.0 out=$prefix/lib/libvoidageLammps.so ;;
  *) echo "build.sh: $program: type liggghts or lammps" >&2; exit 2 ;;
esac
library=/usr/lib/x86_64-linux-gnu/$library
abi=$here/../adapters/client/include
newer=$(find "$here" "$abi" "$library" \( -name '*.cpp' -o -name '*.h' -o -name '*.sh' -o -name 'lib*' \) -newer "$out" 2>/dev/null || echo all)
[ -e "$out" ] && [ -z "$newer" ] && exit 0
mkdir -p "$prefix/lib"
OMPI_CXX=g++ mpicxx -std=c++11 -O2 -fPIC -Wall -Wextra -Wno-unused-parameter "-fmacro-prefix-map=$here=liggghts-fix" -isystem "$headers" -I"$abi" -shared \
  -o "$out.part" "$here/fix_voidage.cpp" "$here/exchange.cpp" "$here/restart.cpp" "$here/host.cpp" \
  "$here/host_$program.cpp" "$library" -L"$prefix/lib" -lvoidage_client -ldl '-Wl,-rpath,$ORIGIN' -Wl,--no-undefined
mv "$out.part" "$out"
