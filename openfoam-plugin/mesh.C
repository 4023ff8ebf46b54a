// SPDX-License-Identifier: GPL-3.0-or-later
// Sends the mesh of this rank: points, faces, owner/neighbour, patches with their links, global cell ids.
#include "link.H"
#include "Time.H"
#include "labelIOList.H"
#include "cyclicPolyPatch.H"
#include "emptyPolyPatch.H"
#include "processorPolyPatch.H"
#include "processorCyclicPolyPatch.H"

using namespace Foam;

namespace voidage
{

// One row of the patch table, and the way to the other side.
struct Row { label kind, start, size, a, b; vector separation; };

static vector average(const vectorField& to, const vectorField& from)
{
    return from.size() ? vector(Foam::sum(to - from)/from.size()) : vector(vector::zero);
}

static Row row(const polyPatch& patch)
{
    Row r = {VOIDAGE_PATCH_BOUNDARY, patch.start(), patch.size(), -1, -1, vector::zero};
    if (isA<processorCyclicPolyPatch>(patch))
    {
        const processorCyclicPolyPatch& p = refCast<const processorCyclicPolyPatch>(patch);
        r.kind = VOIDAGE_PATCH_PROCESSOR_CYCLIC;
        r.a = p.neighbProcNo();
        r.b = p.referPatchID();
        r.separation = average(p.neighbFaceCentres(), p.faceCentres());
    }
    else if (isA<processorPolyPatch>(patch))
    {
        r.kind = VOIDAGE_PATCH_PROCESSOR;
        r.a = refCast<const processorPolyPatch>(patch).neighbProcNo();
    }
    else if (isA<cyclicPolyPatch>(patch))
    {
        const cyclicPolyPatch& p = refCast<const cyclicPolyPatch>(patch);
        if (p.transform() == coupledPolyPatch::ROTATIONAL)
        {
            FatalErrorInFunction
                << "voidage: patch " << p.name() << " is a rotational cyclic; only translational ones are "
                << "supported" << exit(FatalError);
        }
        r.kind = VOIDAGE_PATCH_CYCLIC;
        r.b = p.neighbPatchID();
        r.separation = average(p.neighbPatch().faceCentres(), p.faceCentres());
    }
    else if (patch.coupled())
    {
        FatalErrorInFunction
            << "voidage: patch " << patch.name() << " is of type " << patch.type() << "; of the coupled types "
            << "cyclic and processor are supported; type: createPatch to make a cyclic" << exit(FatalError);
    }
    else if (isA<emptyPolyPatch>(patch))
    {
        r.kind = VOIDAGE_PATCH_EMPTY;
    }
    return r;
}

void Link::sendMesh()
{
    const polyBoundaryMesh& patches = mesh_.boundaryMesh();
    const faceList& faces = mesh_.faces();
    const pointField& points = mesh_.points();

    uint64_t corners = 0;
    forAll(faces, f) corners += faces[f].size();
    std::string names;
    forAll(patches, i) names += (i ? "\n" : "") + patches[i].name();

    labelList ids(mesh_.nCells());
    forAll(ids, i) ids[i] = i;
    if (Pstream::parRun())
    {
        ids = labelIOList
        (
            IOobject
            (
                "cellProcAddressing", mesh_.facesInstance(), polyMesh::meshSubDir, mesh_,
                IOobject::MUST_READ, IOobject::NO_WRITE
            )
        );
    }

    const voidage_block blocks[] =
    {
        {VOIDAGE_POINTS, VOIDAGE_F64, 3*uint64_t(points.size())},
        {VOIDAGE_FACE_STARTS, VOIDAGE_I64, uint64_t(faces.size()) + 1},
        {VOIDAGE_FACE_POINTS, VOIDAGE_I64, corners},
        {VOIDAGE_OWNER, VOIDAGE_I64, uint64_t(mesh_.nFaces())},
        {VOIDAGE_NEIGHBOUR, VOIDAGE_I64, uint64_t(mesh_.nInternalFaces())},
        {VOIDAGE_CELL_IDS, VOIDAGE_I64, uint64_t(ids.size())},
        {VOIDAGE_PATCHES, VOIDAGE_I64, 5*uint64_t(patches.size())},
        {VOIDAGE_PATCH_SEPARATIONS, VOIDAGE_F64, 3*uint64_t(patches.size())},
        {VOIDAGE_PATCH_NAMES, VOIDAGE_U8, names.size()}
    };
    if (voidage_begin(link_, VOIDAGE_MESH, 0, mesh_.time().value(), blocks, sizeof(blocks)/sizeof(*blocks))) fail();

    double* x = static_cast<double*>(voidage_array(link_, VOIDAGE_POINTS));
    forAll(points, i) for (direction d = 0; d < 3; ++d) *x++ = points[i][d];

    int64_t* starts = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_FACE_STARTS));
    int64_t* corner = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_FACE_POINTS));
    int64_t start = 0;
    forAll(faces, f)
    {
        starts[f] = start;
        forAll(faces[f], i) corner[start++] = faces[f][i];
    }
    starts[faces.size()] = start;

    int64_t* owner = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_OWNER));
    forAll(mesh_.faceOwner(), f) owner[f] = mesh_.faceOwner()[f];
    int64_t* neighbour = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_NEIGHBOUR));
    for (label f = 0; f < mesh_.nInternalFaces(); ++f) neighbour[f] = mesh_.faceNeighbour()[f];
    int64_t* id = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_CELL_IDS));
    forAll(ids, i) id[i] = ids[i];

    int64_t* table = static_cast<int64_t*>(voidage_array(link_, VOIDAGE_PATCHES));
    double* separation = static_cast<double*>(voidage_array(link_, VOIDAGE_PATCH_SEPARATIONS));
    forAll(patches, i)
    {
        const Row r = row(patches[i]);
        const label columns[5] = {r.kind, r.start, r.size, r.a, r.b};
        for (label c = 0; c < 5; ++c) table[5*i + c] = columns[c];
        for (direction d = 0; d < 3; ++d) separation[3*i + d] = r.separation[d];
    }
    std::copy(names.begin(), names.end(), static_cast<char*>(voidage_array(link_, VOIDAGE_PATCH_NAMES)));
    if (voidage_send(link_)) fail();
}

}
