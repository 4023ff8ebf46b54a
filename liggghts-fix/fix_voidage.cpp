// SPDX-License-Identifier: GPL-2.0-or-later
// The fix's life: set-up, forces in each DEM step, exchanges every `interval` steps. See fix_voidage.h.
//
// Velocity Verlet: a force computed in post_force acts through the second half kick of this step and the
// first of the next, so v moves from step n-1/2 to n+1/2 with it; the impulse `taken` sums these half kicks.
// The exchange is in end_of_step, where v is at the full step: the new force replaces the old one in f.

#include "fix_voidage.h"
#include "host.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "update.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

using namespace LAMMPS_NS;
using namespace FixConst;

FixVoidage::FixVoidage(LAMMPS *lmp, int narg, char **arg)
  : Fix(lmp, narg, arg), link_(NULL), a_(NULL), width_(COLUMNS), memory_(0), rows_(0), first_step_(-1), step_(0), exchange_(0),
    restored_(-1), last_(false), interval_(1), explicit_limit_(0.2), added_(0.0), history_(false), types_(false),
    spins_(false), added_sent_(false), rotation_(false), constant_force_(false), ended_(false), quit_(false), runs_after_(0), integrated_(0), frozen_(0)
{
  check_host();
  if (narg != 3 || strcmp(arg[1], "all") != 0)
    host::fail_all(lmp, "fix voidage: it takes no arguments and works on all particles; type: fix ID all voidage");
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag)
    host::fail_all(lmp, std::string("fix voidage: the atom style has no radius, mass and angular velocity per particle; "
                                    "type: atom_style ") + host::atom_style);
  if (!atom->tag_enable)
    host::fail_all(lmp, "fix voidage: the particles have no numbers; leave `atom_modify id no` out");
  for (int i = 0; i < 9; i++) totals_[i] = 0.0;
  nevery = 1;
  create_attribute = 1;
  restart_global = 1;
  restart_peratom = 1;
  vector_flag = 1;
  size_vector = 6;
  global_freq = 1;
  extvector = 1;
  grow_arrays(atom->nmax);
  atom->add_callback(0);
  atom->add_callback(1);
  for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
}

FixVoidage::~FixVoidage()
{
  atom->delete_callback(id, 0);
  atom->delete_callback(id, 1);
  memory->destroy(a_);
  if (link_) {
    char text[200];
    snprintf(text, sizeof text, "the script ended or removed the fix at step " BIGINT_FORMAT ", before the fluid's endTime; "
             "make its last run longer, type: run 1000000000", step_);
    voidage_fail(link_, text);
  }
  voidage_close(link_);
}

int FixVoidage::setmask() { return POST_FORCE | END_OF_STEP; }

void FixVoidage::init()
{
  if (strncmp(update->integrate_style, "verlet", 6) != 0)
    host::fail_all(lmp, std::string("fix voidage: run_style ") + update->integrate_style +
                          " does not call it in every step; type: run_style verlet");
  integrated_ = frozen_ = 0;
  bool after = false;
  for (int i = 0; i < modify->nfix; i++) {
    Fix *f = modify->fix[i];
    if (f == this) { after = true; continue; }
    if (strcmp(f->style, style) == 0)
      host::fail_all(lmp, "fix voidage: there are two of them; keep one");
    if (f->time_integrate) integrated_ |= f->groupbit;
    if (strncmp(f->style, "freeze", 6) == 0) frozen_ |= f->groupbit;
    if (after && (modify->fmask[i] & POST_FORCE) && strncmp(f->style, "freeze", 6) != 0) {
      std::string text = std::string("fix voidage: fix ") + f->id + " (" + f->style +
                         ") adds forces after it; put the line `fix ... voidage` behind it in the script";
      host::fail_all(lmp, text);
    }
  }
}

void FixVoidage::setup(int vflag)
{
  (void)vflag;
  if (first_step_ < 0) {
    open();
    first_step_ = update->ntimestep;
    if (setting("coupling.resumed") != 0.0) {
      resume((bigint)setting("coupling.first_exchange"));
      return;  // the forces are those of the restart file
    }
    // a file of an older coupled run is only a bed to start from
    if (restored_ >= 0)
      for (int i = 0; i < atom->nlocal; i++) set_arrays(i);
    exchange();
  }
  if (ended_) return run_after_end();
  // f was cleared and computed anew for this run; v is at a full step, so a half kick follows
  double **f = atom->f;
  for (int i = 0; i < atom->nlocal; i++) {
    double fd[3];
    if (constant_force_) memcpy(fd, &a_[i][FORCE], sizeof fd);
    else fluid_force(i, 0.5 * update->dt, fd);
    for (int k = 0; k < 3; k++) f[i][k] += a_[i][FORCE + k] = fd[k];
    if (!rotation_) continue;
    fluid_torque(i, 0.5 * update->dt, fd);
    for (int k = 0; k < 3; k++) atom->torque[i][k] += a_[i][TORQUE + k] = fd[k];
  }
}

// Without a fluid a later `run` would go on for its 1000000000 steps: it ends after one. A loop of runs (`run N every`,
// `jump`) would begin the next for ever: the program ends well.
void FixVoidage::run_after_end()
{
  host::end_run(lmp);
  quit_ = true;
  if (runs_after_++ < 100) return;
  const char *text = "fix voidage: a hundred runs since the end of the coupled run; the script ends here\n";
  if (comm->me == 0 && screen) fputs(text, screen);
  if (comm->me == 0 && logfile) fputs(text, logfile);
  MPI_Finalize();
  exit(0);
}

bool FixVoidage::moves(int i) const { return (atom->mask[i] & integrated_) && !(atom->mask[i] & frozen_); }

// Force of the fluid for a kick of duration h (s) from the present v; f holds all other forces.
void FixVoidage::fluid_force(int i, double h, double *fd) const
{
  const double *a = a_[i], *v = atom->v[i], *f = atom->f[i];
  const bool free = moves(i);
  const double r = atom->radius[i], m = atom->rmass[i], kc = a[K];
  // (m + ma) dv/dt = all other forces, so light particles are stable
  const double added = added_sent_ ? a[ADDED] : added_ * 4.0 / 3.0 * M_PI * r * r * r;
  const double ma = free ? added : 0.0, x = kc * update->dt / (m + ma);
  if (x <= explicit_limit_ || !free || constant_force_) {
    for (int k = 0; k < 3; k++) {
      fd[k] = kc * (a[U + k] - v[k]) + a[F + k];
      if (ma > 0.0) fd[k] = m / (m + ma) * (f[k] + fd[k]) - f[k];
    }
    return;
  }
  // exact relaxation over h towards u + (other forces)/K; exact at rest and at terminal velocity for any x
  const double rate = -m / h * expm1(-kc * h / (m + ma));
  for (int k = 0; k < 3; k++) {
    const double other = f[k] + a[F + k];
    fd[k] = rate * (a[U + k] + other / kc - v[k]) - f[k];
  }
}

// Torque of the fluid for a kick of duration h (s) from the present w; torque holds all others. As the force.
void FixVoidage::fluid_torque(int i, double h, double *td) const
{
  const double *a = a_[i], *w = atom->omega[i], *torque = atom->torque[i];
  const double r = atom->radius[i], inertia = 0.4 * atom->rmass[i] * r * r, kw = a[SPIN_K];
  if (kw * update->dt / inertia <= explicit_limit_ || !moves(i)) {
    for (int k = 0; k < 3; k++) td[k] = kw * (a[SPIN + k] - w[k]);
    return;
  }
  const double rate = -inertia / h * expm1(-kw * h / inertia);
  for (int k = 0; k < 3; k++) td[k] = rate * (a[SPIN + k] + torque[k] / kw - w[k]) - torque[k];
}

void FixVoidage::post_force(int vflag)
{
  (void)vflag;
  if (ended_) return;
  double **f = atom->f;
  const double half = 0.5 * update->dt;
  for (int i = 0; i < atom->nlocal; i++) {
    double fd[3];
    if (constant_force_) memcpy(fd, &a_[i][FORCE], sizeof fd);
    else fluid_force(i, update->dt, fd);
    for (int k = 0; k < 3; k++) {
      const double impulse = half * (a_[i][FORCE + k] + fd[k]);
      a_[i][TAKEN + k] += impulse;
      totals_[k] += impulse;
      a_[i][FORCE + k] = fd[k];
      f[i][k] += fd[k];
    }
    if (!rotation_) continue;
    fluid_torque(i, update->dt, fd);
    for (int k = 0; k < 3; k++) atom->torque[i][k] += a_[i][TORQUE + k] = fd[k];
  }
}

void FixVoidage::end_of_step()
{
  step_ = update->ntimestep;
  if (ended_ || (update->ntimestep - first_step_) % interval_ != 0 || update->ntimestep == first_step_) return;
  exchange_++;
  exchange();
  if (ended_) return;
  double **f = atom->f;
  for (int i = 0; i < atom->nlocal; i++) {
    double fd[3];
    for (int k = 0; k < 3; k++) f[i][k] -= a_[i][FORCE + k];
    fluid_force(i, 0.5 * update->dt, fd);
    for (int k = 0; k < 3; k++) f[i][k] += a_[i][FORCE + k] = fd[k];
    if (!rotation_) continue;
    for (int k = 0; k < 3; k++) atom->torque[i][k] -= a_[i][TORQUE + k];
    fluid_torque(i, 0.5 * update->dt, fd);
    for (int k = 0; k < 3; k++) atom->torque[i][k] += a_[i][TORQUE + k] = fd[k];
  }
  save();
}

void FixVoidage::post_run()
{
  if (!quit_) return;
  host::run_ended(lmp);
  quit_ = false;
}

// 1-3: force of the fluid, N; 4-6: ledger, N s; sums over all particles
double FixVoidage::compute_vector(int n)
{
  const int column = n < 3 ? FORCE + n : LEDGER + n - 3;
  double own = 0.0, all = 0.0;
  for (int i = 0; i < atom->nlocal; i++) own += a_[i][column];
  MPI_Allreduce(&own, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

double FixVoidage::memory_usage() { return (double)rows_ * width_ * sizeof(double); }

void FixVoidage::grow_arrays(int nmax)
{
  memory->grow(a_, nmax, width_, "voidage:per_atom");
  rows_ = nmax;
}

// Another number of columns for the coupler's memory; what stands in the others stays.
void FixVoidage::widen(int wanted)
{
  if (wanted == memory_) return;
  const int width = COLUMNS + wanted;
  double **wide = NULL;
  memory->create(wide, rows_, width, "voidage:per_atom");
  for (int i = 0; i < atom->nlocal; i++) {
    memset(wide[i], 0, width * sizeof(double));
    memcpy(wide[i], a_[i], COLUMNS * sizeof(double));
  }
  memory->destroy(a_);
  a_ = wide;
  width_ = width;
  memory_ = wanted;
}

void FixVoidage::copy_arrays(int i, int j, int) { memcpy(a_[j], a_[i], width_ * sizeof(double)); }

// A particle inserted feels no fluid until the next exchange.
void FixVoidage::set_arrays(int i) { memset(a_[i], 0, width_ * sizeof(double)); }

int FixVoidage::pack_exchange(int i, double *buf)
{
  memcpy(buf, a_[i], width_ * sizeof(double));
  return width_;
}

int FixVoidage::unpack_exchange(int i, double *buf)
{
  memcpy(a_[i], buf, width_ * sizeof(double));
  return width_;
}
