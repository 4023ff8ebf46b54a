// SPDX-License-Identifier: GPL-2.0-or-later
// LAMMPS 29Sep2021, Debian's package: see host.h.

#include "host.h"

#include "atom.h"
#include "comm_brick.h"
#include "comm_tiled.h"
#include "domain.h"
#include "error.h"
#include "lammps.h"
#include "timer.h"
#include "write_restart.h"

#include <vector>

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

// LAMMPS writes on steps on which it rebuilds neighbours, so atoms are in the periodic box: `read_restart` loses others.
// Here they are put there for the file only; the neighbours of this run go by where they were.
void write_restart(LAMMPS *lmp, const std::string &file)
{
  Atom *atom = lmp->atom;
  std::vector<double> x;
  std::vector<imageint> image;
  for (int i = 0; i < atom->nlocal; i++) {
    x.insert(x.end(), atom->x[i], atom->x[i] + 3);
    image.push_back(atom->image[i]);
  }
  if (lmp->domain->triclinic) lmp->domain->x2lamda(atom->nlocal);
  lmp->domain->pbc();
  if (lmp->domain->triclinic) lmp->domain->lamda2x(atom->nlocal);
  WriteRestart writer(lmp);
  writer.multiproc_options(0, 0, 0, NULL);
  writer.write(file);
  for (int i = 0; i < atom->nlocal; i++) {
    for (int k = 0; k < 3; k++) atom->x[i][k] = x[3 * i + k];
    atom->image[i] = image[i];
  }
}

size_t size_of(const Comm *comm) { return comm->style == 0 ? sizeof(CommBrick) : sizeof(CommTiled); }

}  // namespace host
