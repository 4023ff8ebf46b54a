// SPDX-License-Identifier: GPL-3.0-or-later
// Solves the implicit smoothing steps of src/smooth/pcg.rs with OpenFOAM's own operators and PCG, and prints the
// iterations of each field and step. Reads 0/f0 ... f6, 0/where (x + 10 y + 100 z of the cell centres as voidage
// numbers them, m) and `diffusion` (T, m2) from system/controlDict.
#include "fvCFD.H"

int main(int argc, char* argv[])
{
    #include "setRootCase.H"
    #include "createTime.H"
    #include "createMesh.H"
    const scalar T(runTime.controlDict().get<scalar>("diffusion"));
    const auto read = [&](const word& name)
    {
        return tmp<volScalarField>(new volScalarField
        (
            IOobject(name, runTime.timeName(), mesh, IOobject::MUST_READ, IOobject::NO_WRITE, false), mesh
        ));
    };
    const volScalarField where(read("where"));
    const scalarField gap
    (
        mag
        (
            where.primitiveField() - mesh.C().primitiveField().component(0)
          - 10*mesh.C().primitiveField().component(1) - 100*mesh.C().primitiveField().component(2)
        )
    );
    if (gMax(gap) > 1e-9) FatalErrorInFunction << "cells are numbered differently" << exit(FatalError);
    for (const label steps : {3, 1})
    {
        // Crank-Nicolson in three steps, backward Euler in one
        const scalar theta = steps == 1 ? 1 : 0.5;
        const dimensionedScalar rDt("rDt", dimensionSet(0, -2, 0, 0, 0, 0, 0), steps/T);
        for (label i = 0; i < 7; ++i)
        {
            volScalarField phi(read("f" + Foam::name(i)));
            for (label step = 0; step < steps; ++step)
            {
                const volScalarField old("old", phi);
                fvScalarMatrix equation
                (
                    fvm::Sp(rDt, phi) - theta*fvm::laplacian(phi) - rDt*old - (1 - theta)*fvc::laplacian(old)
                );
                const auto solved = equation.solve();
                Info<< "COUNT " << steps << ' ' << i << ' ' << step << ' ' << solved.nIterations() << endl;
            }
        }
    }
    return 0;
}
