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
#include "domain.h"
#include "update.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

using namespace LAMMPS_NS;

namespace {

// The programs write on steps on which they rebuild neighbours: then all atoms are in the box, and `read_restart` takes no
// others. This writes on any step, so for the file alone atoms outside are put to the other side (periodic), onto the side
// (fixed), or the side goes out to them (shrink-wrapped); the neighbours of the run go by where they were.
class InBox {
 public:
  InBox(Atom *atom, Domain *domain, MPI_Comm world) : atom_(atom), domain_(domain)
  {
    const int n = atom->nlocal;
    for (int i = 0; i < n; i++) {
      x_.insert(x_.end(), atom->x[i], atom->x[i] + 3);
      image_.push_back(atom->image[i]);
    }
    if (domain->triclinic) domain->x2lamda(n);
    domain->pbc();
    if (domain->triclinic) domain->lamda2x(n);
    for (int k = 0; k < 3; k++) {
      low_[k] = domain->boxlo[k];
      high_[k] = domain->boxhi[k];
      if (domain->boundary[k][0] == 0 || domain->triclinic) continue;
      double ends[2] = {low_[k], -high_[k]};  // lowest, -highest
      for (int i = 0; i < n; i++) {
        double &x = atom->x[i][k];
        // 1: fixed; the upper side is no part of the box
        if (domain->boundary[k][0] == 1) x = fmax(x, low_[k]);
        if (domain->boundary[k][1] == 1) x = fmin(x, nextafter(high_[k], low_[k]));
        ends[0] = fmin(ends[0], x);
        ends[1] = fmin(ends[1], -nextafter(x, HUGE_VAL));
      }
      MPI_Allreduce(MPI_IN_PLACE, ends, 2, MPI_DOUBLE, MPI_MIN, world);
      domain->boxlo[k] = ends[0];
      domain->boxhi[k] = -ends[1];
    }
  }

  ~InBox()
  {
    for (int k = 0; k < 3; k++) {
      domain_->boxlo[k] = low_[k];
      domain_->boxhi[k] = high_[k];
    }
    for (int i = 0; i < atom_->nlocal; i++) {
      for (int k = 0; k < 3; k++) atom_->x[i][k] = x_[3 * i + k];
      atom_->image[i] = image_[i];
    }
  }

 private:
  typedef std::remove_pointer<decltype(Atom::image)>::type Image;
  Atom *atom_;
  Domain *domain_;
  std::vector<double> x_;
  std::vector<Image> image_;
  double low_[3], high_[3];
};

}  // namespace

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
  {
    InBox moved(atom, domain, world);
    host::write_restart(lmp, part);
  }
  MPI_Barrier(world);
  if (comm->me == 0 && rename(part.c_str(), restart_file_.c_str()) != 0)
    stop(("the restart file " + restart_file_ + " could not be written; is the disk full?").c_str());
  MPI_Barrier(world);
  restart_file_.clear();
  if (voidage_begin(link_, VOIDAGE_WRITTEN, exchange_, update->ntimestep * update->dt, NULL, 0) || voidage_send(link_))
    stop(voidage_last_error());
  if (last_) receive();
}
