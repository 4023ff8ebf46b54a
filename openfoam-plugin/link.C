// SPDX-License-Identifier: GPL-3.0-or-later
#include "link.H"
#include "Time.H"
#include "IOdictionary.H"
#include "dimensionedScalar.H"

#include <cstdio>
#include <memory>

using namespace Foam;

namespace voidage
{

static std::unique_ptr<Link> theLink;

Link& Link::New(const fvMesh& mesh)
{
    if (!theLink) theLink.reset(new Link(mesh));
    return *theLink;
}

void Link::fail() const
{
    FatalErrorInFunction << "voidage: " << voidage_last_error() << exit(FatalError);
}

void Link::giveUp(const std::string& why) const
{
    voidage_fail(link_, why.c_str());
    FatalErrorInFunction << "voidage: " << why.c_str() << exit(FatalError);
}

Link::Link(const fvMesh& mesh)
:
    link_(nullptr),
    mesh_(mesh),
    first_(0),
    exchange_(-1),
    received_(-1)
{
    const Time& time = mesh.time();
    const scalar dt = time.deltaTValue();
    // the start of the run: in a stock solver the link is opened within the first step
    link_ = voidage_open
    (
        VOIDAGE_CFD, Pstream::myProcNo(), Pstream::nProcs(), dt, time.startTimeIndex(), time.startTime().value(),
        ("OpenFOAM " + std::to_string(OPENFOAM)).c_str()
    );
    if (!link_) fail();

    first_ = label(setting("coupling.first_exchange"));
    exchange_ = received_ = first_ - 1;
    const scalar wanted = setting("fluid.time_step");
    if (mag(dt - wanted) > 1e-9*wanted)
    {
        FatalErrorInFunction
            << "voidage: system/controlDict has deltaT " << dt << " s; dem.time_step x coupling.interval of "
            << "case.toml is " << wanted << " s; make them equal, e.g. type: deltaT " << wanted << ";"
            << exit(FatalError);
    }
    if (time.controlDict().lookupOrDefault("adjustTimeStep", false))
    {
        FatalErrorInFunction
            << "voidage: system/controlDict has adjustTimeStep yes; the coupling needs a fixed step; type: "
            << "adjustTimeStep no;" << exit(FatalError);
    }
    sendMesh();
}

Link::~Link()
{
    voidage_close(link_);
}

scalar Link::setting(const char* name) const
{
    double value = 0;
    if (voidage_setting(link_, name, &value) != 0) fail();
    return value;
}

vector Link::vectorSetting(const char* name) const
{
    const std::string base(name);
    return vector
    (
        setting((base + ".x").c_str()), setting((base + ".y").c_str()), setting((base + ".z").c_str())
    );
}

bool Link::lastStep() const
{
    const Time& time = mesh_.time();
    return time.value() > time.endTime().value() - 0.5*time.deltaTValue();
}

static void put(voidage_link* link, unsigned field, const vectorField& values)
{
    double* to = static_cast<double*>(voidage_array(link, field));
    forAll(values, i)
    {
        for (direction d = 0; d < 3; ++d) to[3*i + d] = values[i][d];
    }
}

void Link::sendFields(const State& s)
{
    // controlDict is read again when it changes, and function objects may set the step
    const scalar dt = mesh_.time().deltaTValue(), wanted = setting("fluid.time_step");
    if (mag(dt - wanted) > 1e-9*wanted)
    {
        char text[200];
        std::snprintf(text, sizeof text, "deltaT became %g s during the run; the coupling has steps of %g s: make controlDict's "
            "deltaT that again and continue with --restart", dt, wanted);
        giveUp(text);
    }
    ++exchange_;
    const uint64_t n = mesh_.nCells();
    voidage_block blocks[5];
    size_t count = 0;
    blocks[count++] = {VOIDAGE_FLUID_VELOCITY, VOIDAGE_F64, 3*n};
    blocks[count++] = {VOIDAGE_REACTION, VOIDAGE_F64, 3};
    blocks[count++] = {VOIDAGE_FLAGS, VOIDAGE_F64, 2};
    if (s.pressureGradient) blocks[count++] = {VOIDAGE_PRESSURE_GRADIENT, VOIDAGE_F64, 3*n};
    if (s.stressDivergence) blocks[count++] = {VOIDAGE_STRESS_DIVERGENCE, VOIDAGE_F64, 3*n};
    if (voidage_begin(link_, VOIDAGE_FIELDS, exchange_, mesh_.time().value(), blocks, count)) fail();
    put(link_, VOIDAGE_FLUID_VELOCITY, *s.velocity);
    if (s.pressureGradient) put(link_, VOIDAGE_PRESSURE_GRADIENT, *s.pressureGradient);
    if (s.stressDivergence) put(link_, VOIDAGE_STRESS_DIVERGENCE, *s.stressDivergence);
    double* reaction = static_cast<double*>(voidage_array(link_, VOIDAGE_REACTION));
    for (direction d = 0; d < 3; ++d) reaction[d] = s.reaction[d];
    double* flags = static_cast<double*>(voidage_array(link_, VOIDAGE_FLAGS));
    flags[0] = s.last;
    flags[1] = s.write;
    if (voidage_send(link_)) fail();
}

void Link::copy(unsigned field, scalarField& to) const
{
    uint64_t n = 0;
    const double* from = static_cast<const double*>(voidage_read(link_, field, &n));
    if (!from) fail();
    if (label(n) != mesh_.nCells()) FatalErrorInFunction << "voidage: array " << field << " is short" << exit(FatalError);
    to.setSize(n);
    forAll(to, i) to[i] = from[i];
}

void Link::copy(unsigned field, vectorField& to) const
{
    uint64_t n = 0;
    const double* from = static_cast<const double*>(voidage_read(link_, field, &n));
    if (!from) fail();
    if (label(n) != 3*mesh_.nCells()) FatalErrorInFunction << "voidage: array " << field << " is short" << exit(FatalError);
    to.setSize(n/3);
    forAll(to, i) to[i] = vector(from[3*i], from[3*i + 1], from[3*i + 2]);
}

const Sources& Link::receive()
{
    const int kind = voidage_receive(link_);
    if (kind < 0) fail();
    if (kind == VOIDAGE_STOP)
    {
        const std::string reason = voidage_stop_reason(link_);
        FatalErrorInFunction
            << "voidage: the coupled run was stopped: " << (reason.empty() ? "it ended early" : reason.c_str())
            << exit(FatalError);
    }
    if (kind != VOIDAGE_SOURCES || voidage_step(link_) != int64_t(received_ + 1))
    {
        FatalErrorInFunction
            << "voidage: message " << kind << " of exchange " << label(voidage_step(link_)) << " came where sources "
            << received_ + 1 << " were due" << exit(FatalError);
    }
    ++received_;
    copy(VOIDAGE_VOIDAGE, sources_.voidage);
    copy(VOIDAGE_VOIDAGE_OLD, sources_.voidageOld);
    copy(VOIDAGE_SP, sources_.sp);
    copy(VOIDAGE_SU, sources_.su);
    if (on("fluid.continuity")) copy(VOIDAGE_SOLIDS_FLUX, sources_.solidsFlux);
    else sources_.solidsFlux = vectorField(mesh_.nCells(), vector::zero);
    voidage_release(link_);
    return sources_;
}

}
