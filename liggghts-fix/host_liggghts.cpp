// SPDX-License-Identifier: GPL-2.0-or-later
// LIGGGHTS 3.8.0: see host.h.

#include "host.h"

#include "comm.h"
#include "error.h"
#include "fix.h"
#include "lammps.h"
#include "modify.h"
#include "write_restart.h"

#include <cstring>

using namespace LAMMPS_NS;

namespace LAMMPS_NS { namespace SignalHandler { extern bool request_quit; } }

namespace host {

const char *const program = "LIGGGHTS", *const package = "liggghts", *const atom_style = "granular";

std::string version(LAMMPS *) { return "LIGGGHTS 3.8.0"; }

void fail_all(LAMMPS *lmp, const std::string &text) { lmp->error->all(FLERR, text.c_str()); }
void fail_one(LAMMPS *lmp, const std::string &text) { lmp->error->one(FLERR, text.c_str()); }

void end_run(LAMMPS *) { SignalHandler::request_quit = true; }
void run_ended(LAMMPS *) { SignalHandler::request_quit = false; }

void write_restart(LAMMPS *lmp, const std::string &file)
{
  // contacts are copied to the atoms only when neighbours are rebuilt: copy them now
  for (int i = 0; i < lmp->modify->nfix; i++)
    if (strcmp(lmp->modify->fix[i]->style, "contacthistory") == 0) lmp->modify->fix[i]->setup_pre_exchange();
  std::string name = file;
  WriteRestart writer(lmp);
  writer.write(&name[0]);
}

size_t size_of(const Comm *) { return sizeof(Comm); }

}  // namespace host
