// SPDX-License-Identifier: GPL-3.0-or-later
// Coupling of stock OpenFOAM solvers, for dilute scenes: a function object `voidage` that sends the fluid after
// each step, and an fvOption `voidageSource` that puts (Su - Sp U)/rho into the momentum equation.
//
// The solver knows no voidage: model B only (no pressure-gradient force, which needs the solver's own share).
// controlDict: functions { voidage { type voidage; } }; for --restart startFrom latestTime
// fvOptions:   voidage { type voidageSource; voidageSourceCoeffs { fields (U); } }
// `voidage run` preloads this library: solvers make their fvOptions before they load those of function objects.
#include "addToRunTimeSelectionTable.H"
#include "fvMatrices.H"
#include "fvMeshFunctionObject.H"
#include "fvOption.H"
#include "fvmSup.H"
#include "fvcGrad.H"
#include "link.H"
#include "surfaceFields.H"
#include "volFields.H"

namespace Foam
{

// Sends the state; what both parts need.
static void sendState(const fvMesh& mesh, bool stepDone)
{
    voidage::Link& link = voidage::Link::New(mesh);
    const scalar rho = link.setting("fluid.density");
    const volVectorField& U = mesh.lookupObject<volVectorField>("U");
    const vectorField velocity(U.primitiveField());
    vectorField gradP;
    voidage::State s;
    s.velocity = &velocity;
    if (link.on("send.pressure_gradient"))
    {
        gradP = rho*fvc::grad(mesh.lookupObject<volScalarField>("p"))().primitiveField();
        s.pressureGradient = &gradP;
    }
    s.last = stepDone && link.lastStep();
    s.write = stepDone && mesh.time().writeTime();
    if (stepDone && link.on("fluid.two_way"))
    {
        const voidage::Sources& q = link.sources();
        const scalar dt = mesh.time().deltaTValue();
        vector sum = vector::zero, lost = vector::zero;
        forAll(velocity, i)
        {
            const vector y = -mesh.V()[i]*dt*(q.su[i] - q.sp[i]*velocity[i]) - lost, t = sum + y;
            lost = (t - sum) - y;
            sum = t;
        }
        s.reaction = sum;
    }
    link.sendFields(s);
}

// Opens the link once and hands over the state at the start.
static voidage::Link& started(const fvMesh& mesh)
{
    voidage::Link& link = voidage::Link::New(mesh);
    if (link.exchange() < link.first())
    {
        if (link.setting("fluid.model") == 1 || link.on("send.stress_divergence"))
        {
            link.giveUp
            (
                "coupling.model = \"A\" needs a solver that knows the voidage; type: coupling.model = \"B\" "
                "and forces.viscous_stress = false, or fluid.solver = \"voidageFoam\""
            );
        }
        sendState(mesh, false);
        link.receive();
    }
    return link;
}

namespace functionObjects
{

class voidageCoupling : public fvMeshFunctionObject
{
public:

    TypeName("voidage");

    voidageCoupling(const word& name, const Time& time, const dictionary& dict)
    :
        fvMeshFunctionObject(name, time, dict)
    {}

    // Runs after each step. The first action of the link is here or in the fvOption, whichever comes first.
    virtual bool execute()
    {
        voidage::Link& link = started(mesh_);
        const label done = time_.timeIndex() - time_.startTimeIndex();
        if (done > 0 && link.exchange() - link.first() < done)
        {
            if (link.received() == link.exchange())
            {
                link.giveUp
                (
                    "the solver took no sources in this step: constant/fvOptions needs voidage { type voidageSource; "
                    "voidageSourceCoeffs { fields (U); } }, and a solver that reads fvOptions (icoFoam does not)"
                );
            }
            sendState(mesh_, true);
        }
        return true;
    }

    virtual bool write() { return true; }
};

defineTypeNameAndDebug(voidageCoupling, 0);
addToRunTimeSelectionTable(functionObject, voidageCoupling, dictionary);

}

namespace fv
{

class voidageSource : public option
{
    label received_;

public:

    TypeName("voidageSource");

    voidageSource(const word& name, const word& type, const dictionary& dict, const fvMesh& mesh)
    :
        option(name, type, dict, mesh),
        received_(-1)
    {
        coeffs_.readEntry("fields", fieldNames_);
        applied_.setSize(fieldNames_.size(), false);
    }

    // Called in every outer corrector: the sources of a step arrive once.
    virtual void addSup(fvMatrix<vector>& eqn, const label)
    {
        voidage::Link& link = started(mesh_);
        if (received_ != mesh_.time().timeIndex())
        {
            received_ = mesh_.time().timeIndex();
            if (link.received() > link.exchange())
            {
                link.giveUp
                (
                    "the step before was not sent: system/controlDict needs functions { voidage { type voidage; } }, "
                    "executed after each step"
                );
            }
            link.receive();
        }
        const voidage::Sources& q = link.sources();
        const scalar rho = link.setting("fluid.density");
        DimensionedField<vector, volMesh> su
        (
            IOobject("voidage:Su", mesh_.time().timeName(), mesh_), mesh_,
            dimensionedVector("0", eqn.dimensions()/dimVolume, Zero)
        );
        DimensionedField<scalar, volMesh> sp
        (
            IOobject("voidage:Sp", mesh_.time().timeName(), mesh_), mesh_,
            dimensionedScalar("0", eqn.dimensions()/dimVolume/dimVelocity, 0)
        );
        forAll(su, i)
        {
            su[i] = q.su[i]/rho;
            sp[i] = q.sp[i]/rho;
        }
        eqn += su - fvm::Sp(sp, eqn.psi());
    }
};

defineTypeNameAndDebug(voidageSource, 0);
addToRunTimeSelectionTable(option, voidageSource, dictionary);

}
}
