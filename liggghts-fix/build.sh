#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# build.sh HEADERS PREFIX: builds PREFIX/lib/libvoidageLiggghts.so against Debian's LIGGGHTS.
set -eu
headers=$1 prefix=$2
here=$(cd "$(dirname "$0")" && pwd)
library=/usr/lib/x86_64-linux-gnu/libliggghts.so.3
out=$prefix/lib/libvoidageLiggghts.so
abi=$here/../adapters/client/include
newer=$(find "$here" "$abi" "$library" \( -name '*.cpp' -o -name '*.h' -o -name '*.sh' -o -name 'lib*' \) -newer "$out" 2>/dev/null || echo all)
[ -e "$out" ] && [ -z "$newer" ] && exit 0
mkdir -p "$prefix/lib"
OMPI_CXX=g++ mpicxx -std=c++11 -O2 -fPIC -Wall -Wextra -Wno-unused-parameter -isystem "$headers" -I"$abi" -shared \
  -o "$out.part" "$here/fix_voidage.cpp" "$here/exchange.cpp" "$here/restart.cpp" "$here/host.cpp" \
  "$library" -L"$prefix/lib" -lvoidage_client -ldl '-Wl,-rpath,$ORIGIN' -Wl,--no-undefined
mv "$out.part" "$out"
