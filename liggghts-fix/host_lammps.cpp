// SPDX-License-Identifier: GPL-2.0-or-later
// LAMMPS 29Sep2021, Debian's package: see host.h.

#include "host.h"

#include "comm_brick.h"
#include "comm_tiled.h"
#include "error.h"
#include "lammps.h"
#include "timer.h"
#include "write_restart.h"

using namespace LAMMPS_NS;

namespace host {

const char *const program = "LAMMPS", *const package = "lammps", *const atom_style = "sphere";

std::string version(LAMMPS *lmp) { return std::string("LAMMPS ") + lmp->version; }

// the text as a string: of a `char *` LAMMPS would take braces for fields to fill
void fail_all(LAMMPS *lmp, const std::string &text) { lmp->error->all(FLERR, text); }
void fail_one(LAMMPS *lmp, const std::string &text) { lmp->error->one(FLERR, text); }

// as `fix halt` does it
void end_run(LAMMPS *lmp) { lmp->timer->force_timeout(); }
void run_ended(LAMMPS *lmp) { lmp->timer->reset_timeout(); }

// contacts are copied to the atoms by their own fix
void write_restart(LAMMPS *lmp, const std::string &file)
{
  WriteRestart writer(lmp);
  writer.multiproc_options(0, 0, 0, NULL);
  writer.write(file);
}

size_t size_of(const Comm *comm) { return comm->style == 0 ? sizeof(CommBrick) : sizeof(CommTiled); }

}  // namespace host
