// SPDX-License-Identifier: GPL-2.0-or-later
// Restart of a coupled run: the fix's table goes into the program's own restart file, written when the coupler asks
// (the fluid's write times), and comes back by `read_restart` and the same `fix` line.
//
// Beside the table each atom carries the force and torque it had: the program would compute them anew from full-step
// velocities, and damping in contacts would act a little otherwise in the first half kick.

#include "fix_voidage.h"
#include "host.h"

#include "atom.h"
#include "comm.h"
#include "update.h"

#include <cstdio>
#include <cstring>
#include <string>

using namespace LAMMPS_NS;

// State of the fix: columns of the table, number of the last exchange, columns of the coupler's memory.
void FixVoidage::write_restart(FILE *fp)
{
  double list[3] = {(double)COLUMNS, (double)exchange_, (double)memory_};
  if (comm->me != 0) return;
  const int size = sizeof list;
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(list, sizeof(double), 3, fp);
}

void FixVoidage::restart(char *buf)
{
  double list[3];
  memcpy(list, buf, sizeof list);
  if ((int)list[0] != (int)COLUMNS)
    host::fail_all(lmp, "fix voidage: the restart file comes from another version of the fix; start the run anew");
  restored_ = (bigint)list[1];
  widen((int)list[2]);
}

int FixVoidage::maxsize_restart() { return 1 + width_; }

int FixVoidage::size_restart(int) { return 1 + width_; }

int FixVoidage::pack_restart(int i, double *buf)
{
  for (int k = 0; k < 3; k++) {
    a_[i][HELD + k] = atom->f[i][k];
    a_[i][HELD + 3 + k] = atom->torque[i][k];
  }
  buf[0] = 1 + width_;
  memcpy(buf + 1, a_[i], width_ * sizeof(double));
  return 1 + width_;
}

void FixVoidage::unpack_restart(int i, int nth)
{
  const double *extra = atom->extra[i];
  int m = 0;
  for (int k = 0; k < nth; k++) m += (int)extra[m];
  memcpy(a_[i], extra + m + 1, width_ * sizeof(double));
}

// The first `run` of a restarted run: takes up exchange `first`, in which this table was filled.
void FixVoidage::resume(bigint first)
{
  if (restored_ < 0)
    stop("the script did not bring the coupled run back; with --restart it must read the restart file before the line "
         "`fix ... voidage`: read_restart ${voidage_restart_file}");
  if (restored_ != first) {
    char text[300];
    snprintf(text, sizeof text, "the restart file read by the script is of exchange " BIGINT_FORMAT ", the coupler's "
             "set is of exchange " BIGINT_FORMAT "; read ${voidage_restart_file}", restored_, first);
    stop(text);
  }
  exchange_ = restored_;
  for (int k = 0; k < 9; k++) totals_[k] = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    for (int k = 0; k < 3; k++) {
      totals_[3 + k] += a_[i][CHARGED + k];
      totals_[6 + k] += a_[i][LEDGER + k];
      atom->f[i][k] = a_[i][HELD + k];
      atom->torque[i][k] = a_[i][HELD + 3 + k];
    }
  }
  send(false);  // the coupler compares; what drives the particles is in the table
}

// After the new force stands in f: writes the file, tells the coupler, and hears of the end if this was the last step.
void FixVoidage::save()
{
  if (restart_file_.empty()) return;
  const std::string part = restart_file_ + ".part";
  host::write_restart(lmp, part);
  MPI_Barrier(world);
  if (comm->me == 0 && rename(part.c_str(), restart_file_.c_str()) != 0)
    stop(("the restart file " + restart_file_ + " could not be written; is the disk full?").c_str());
  MPI_Barrier(world);
  restart_file_.clear();
  if (voidage_begin(link_, VOIDAGE_WRITTEN, exchange_, update->ntimestep * update->dt, NULL, 0) || voidage_send(link_))
    stop(voidage_last_error());
  if (last_) receive();
}
