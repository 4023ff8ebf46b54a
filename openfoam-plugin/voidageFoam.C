// SPDX-License-Identifier: GPL-3.0-or-later
// voidageFoam: volume-averaged incompressible flow through particles, PISO/PIMPLE, coupled by voidage.
//
//   d eps/dt + div(eps U) = 0                                        (or SX eq. 2a: div(eps U) = -div(eps_s U_s))
//   d(eps U)/dt + div(eps U U) = a (-grad p + div tau - grad pbar) + eps g + (Su - Sp U)/rho
//   model A: a = eps; model B: a = 1
//
// The flux that convects is made to satisfy this step's continuity before the momentum equation is built, so
// the conservative form needs no correction and momentum is conserved. Case: 0/U, 0/p; fvSolution: p, pFinal,
// pcorr, U. Coupling fields come per cell from the coupler (link.H); all of its numbers are divided by rho.
#include "fvCFD.H"
#include "fvOptions.H"
#include "pimpleControl.H"
#include "wallFvPatch.H"
#include "singlePhaseTransportModel.H"
#include "turbulentTransportModel.H"
#include "link.H"
#include "sources.H"
#include "clock.H"

int main(int argc, char *argv[])
{
    argList::addNote("volume-averaged incompressible flow, coupled to particles; started by `voidage run CASE`");
    argList::addOption("restartTime", "time", "continue from this write time (voidage run --restart)");
    #include "setRootCase.H"
    voidage::Clock runTime(args);
    #include "createMesh.H"
    pimpleControl pimple(mesh);
    #include "createFields.H"

    link.sendFields(coupling.state(U, p, false));
    coupling.take(link.receive(), voidage);
    voidage.oldTime();

    Info<< "\nStarting time loop\n" << endl;
    while (runTime.run())
    {
        ++runTime;
        Info<< "Time = " << runTime.timeName() << nl << endl;
        coupling.take(link.receive(), voidage);

        if (!coupling.frozen)
        {
            #include "correctFlux.H"
            while (pimple.loop())
            {
                #include "UEqn.H"
                while (pimple.correct())
                {
                    #include "pEqn.H"
                }
                if (pimple.turbCorr())
                {
                    laminarTransport.correct();
                    turbulence->correct();
                }
            }
        }
        link.sendFields(coupling.state(U, p, true));
        #include "report.H"
        runTime.write();
        runTime.printExecutionTime(Info);
    }
    // the coupler confirms that the run is complete
    Info<< "End\n" << endl;
    return 0;
}
