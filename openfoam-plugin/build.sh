#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# build.sh HEADERS PREFIX: builds PREFIX/lib/libvoidageFoam.so and PREFIX/bin/voidageFoam against Debian's OpenFOAM.
set -eu
headers=$1 prefix=$2
here=$(cd "$(dirname "$0")" && pwd)
abi=$here/../adapters/client/include
flags="-std=c++11 -m64 -pthread -DOPENFOAM=1912 -DWM_DP -DWM_LABEL_SIZE=32 -DNoRepository -ftemplate-depth-100 -O2 -fPIC -w"
for dir in "$headers"/*/; do flags="$flags -I${dir%/}"; done
flags="$flags -I$headers/transportModels/incompressible/lnInclude -I$headers/transportModels/incompressible/singlePhaseTransportModel"
flags="$flags -I$headers/transportModels/incompressible/transportModel -I$headers/transportModels/incompressible/viscosityModels/viscosityModel"
flags="$flags -I$abi -I$here"
libs="-L/usr/lib -lfiniteVolume -lfvOptions -lmeshTools -lOpenFOAM"

# stale OUT SOURCE...: is OUT missing or older than a source?
stale() {
  out=$1; shift
  [ -e "$out" ] || return 0
  for f in "$@" "$0"; do [ "$f" -nt "$out" ] && return 0; done
  return 1
}
mkdir -p "$prefix/lib" "$prefix/bin"
lib=$prefix/lib/libvoidageFoam.so
if stale "$lib" "$here"/*.H "$here"/link.C "$here"/mesh.C "$here"/stockSolvers.C "$abi/voidage.h"; then
  # soname: `libs ("libvoidageFoam.so")` of a controlDict finds the one `voidage run` has preloaded
  g++ $flags -shared -o "$lib.part" "$here/link.C" "$here/mesh.C" "$here/stockSolvers.C" $libs \
    -L"$prefix/lib" -lvoidage_client '-Wl,-soname,libvoidageFoam.so' '-Wl,-rpath,$ORIGIN'
  mv "$lib.part" "$lib"
fi
bin=$prefix/bin/voidageFoam
if stale "$bin" "$here"/*.H "$here/voidageFoam.C" "$abi/voidage.h"; then
  g++ $flags -Xlinker --add-needed -Xlinker --no-as-needed -o "$bin.part" "$here/voidageFoam.C" \
    -L"$prefix/lib" -lvoidageFoam -lvoidage_client -L/usr/lib -lfiniteVolume -lfvOptions -lmeshTools -lsampling \
    -lturbulenceModels -lincompressibleTurbulenceModels -lincompressibleTransportModels -lOpenFOAM -lPstream \
    -ldl -lm '-Wl,-rpath,$ORIGIN/../lib'
  mv "$bin.part" "$bin"
fi
