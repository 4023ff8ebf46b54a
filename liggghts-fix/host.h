// SPDX-License-Identifier: GPL-2.0-or-later
// What differs between the two particle programs. One of host_liggghts.cpp and host_lammps.cpp is built with the rest.
#ifndef VOIDAGE_HOST_H
#define VOIDAGE_HOST_H

#include <cstddef>
#include <string>

namespace LAMMPS_NS { class Comm; class LAMMPS; }

namespace host {

extern const char *const program;     // its name
extern const char *const package;     // Debian's package of it
extern const char *const atom_style;  // of spheres with radius, mass and angular velocity

// Name and version, told to the coupler.
std::string version(LAMMPS_NS::LAMMPS *);

// End the program with a message: `all` when every rank comes here.
void fail_all(LAMMPS_NS::LAMMPS *, const std::string &);
void fail_one(LAMMPS_NS::LAMMPS *, const std::string &);

// end_run leaves the loop of the present `run` after this step; run_ended, when it is left, lets later ones go on.
void end_run(LAMMPS_NS::LAMMPS *);
void run_ended(LAMMPS_NS::LAMMPS *);

// A restart file within a run, contacts included.
void write_restart(LAMMPS_NS::LAMMPS *, const std::string &file);

// Size of the object behind the pointer, as the headers have it (bytes).
size_t size_of(const LAMMPS_NS::Comm *);

}  // namespace host

#endif
