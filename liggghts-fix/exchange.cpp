// SPDX-License-Identifier: GPL-2.0-or-later
// The exchange with the coupler: open, send the owned particles, receive what drives them. Copies only.

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

using namespace LAMMPS_NS;

// Ends this program on all ranks with a message; the coupler is told why.
void FixVoidage::stop(const char *text)
{
  if (link_) voidage_fail(link_, text);
  host::fail_one(lmp, std::string("fix voidage: ") + text);
}

double FixVoidage::setting(const char *name)
{
  double value = 0.0;
  if (voidage_setting(link_, name, &value) != 0) stop(voidage_last_error());
  return value;
}

void FixVoidage::open()
{
  link_ = voidage_open(VOIDAGE_DEM, comm->me, comm->nprocs, update->dt, update->ntimestep,
                       update->ntimestep * update->dt, host::version(lmp).c_str());
  if (!link_) stop(voidage_last_error());
  interval_ = (int)setting("coupling.interval");
  explicit_limit_ = setting("dem.explicit_limit");
  added_ = setting("dem.added_mass");
  constant_force_ = setting("dem.constant_force") != 0.0;
  history_ = setting("send.history") != 0.0;
  types_ = setting("send.type") != 0.0;
  spins_ = setting("send.angular_velocity") != 0.0;
  added_sent_ = setting("drive.added_mass") != 0.0;
  rotation_ = setting("drive.rotation") != 0.0;
  const int wanted = (int)setting("drive.memory");
  if (wanted != memory_ && setting("coupling.resumed") != 0.0)
    stop("the restart file was written with other forces: forces.history must be as it was");
  widen(wanted);
  check_settings();
}

void FixVoidage::exchange()
{
  send(true);
  receive();
}

// settle: books the interval that ends here into the ledger.
void FixVoidage::send(bool settle)
{
  const uint64_t n = atom->nlocal;
  voidage_block blocks[15] = {
    {VOIDAGE_ID, VOIDAGE_I64, n}, {VOIDAGE_POSITION, VOIDAGE_F64, 3 * n},
    {VOIDAGE_VELOCITY, VOIDAGE_F64, 3 * n}, {VOIDAGE_RADIUS, VOIDAGE_F64, n}, {VOIDAGE_MASS, VOIDAGE_F64, n},
    {VOIDAGE_IMPULSE, VOIDAGE_F64, 3 * n}, {VOIDAGE_LEDGER, VOIDAGE_F64, 3 * n}, {VOIDAGE_TOTALS, VOIDAGE_F64, 9}};
  size_t count = 8;
  const voidage_block more[] = {
    {VOIDAGE_LAST_DRAG_COEFFICIENT, VOIDAGE_F64, n}, {VOIDAGE_LAST_DRIVE_VELOCITY, VOIDAGE_F64, 3 * n},
    {VOIDAGE_LAST_FORCE, VOIDAGE_F64, 3 * n}, {VOIDAGE_LAST_VELOCITY, VOIDAGE_F64, 3 * n},
    {VOIDAGE_TYPE, VOIDAGE_I64, n}, {VOIDAGE_ANGULAR_VELOCITY, VOIDAGE_F64, 3 * n},
    {VOIDAGE_LAST_MEMORY, VOIDAGE_F64, memory_ * n}};
  for (int k = 0; history_ && k < 4; k++) blocks[count++] = more[k];
  if (types_) blocks[count++] = more[4];
  if (spins_) blocks[count++] = more[5];
  if (memory_) blocks[count++] = more[6];
  if (voidage_begin(link_, VOIDAGE_PARTICLES, exchange_, update->ntimestep * update->dt, blocks, count))
    stop(voidage_last_error());
  int64_t *id = (int64_t *)voidage_array(link_, VOIDAGE_ID);
  int64_t *type = types_ ? (int64_t *)voidage_array(link_, VOIDAGE_TYPE) : NULL;
  double *x = (double *)voidage_array(link_, VOIDAGE_POSITION), *v = (double *)voidage_array(link_, VOIDAGE_VELOCITY);
  double *r = (double *)voidage_array(link_, VOIDAGE_RADIUS), *m = (double *)voidage_array(link_, VOIDAGE_MASS);
  double *w = spins_ ? (double *)voidage_array(link_, VOIDAGE_ANGULAR_VELOCITY) : NULL;
  double *memory = memory_ ? (double *)voidage_array(link_, VOIDAGE_LAST_MEMORY) : NULL;
  double *taken = (double *)voidage_array(link_, VOIDAGE_IMPULSE);
  double *ledger = (double *)voidage_array(link_, VOIDAGE_LEDGER);
  double *totals = (double *)voidage_array(link_, VOIDAGE_TOTALS);
  if (!id || !x || !v || !r || !m || !taken || !ledger || !totals || (types_ && !type) || (spins_ && !w) ||
      (memory_ && !memory)) stop(voidage_last_error());
  for (uint64_t i = 0; i < n; i++) {
    double *a = a_[i];
    id[i] = atom->tag[i];
    if (type) type[i] = atom->type[i];
    if (memory) memcpy(memory + memory_ * i, a + COLUMNS, memory_ * sizeof(double));
    r[i] = atom->radius[i];
    m[i] = atom->rmass[i];
    // particles are moved back into a periodic box only when neighbour lists are built
    double inside[3] = {atom->x[i][0], atom->x[i][1], atom->x[i][2]};
    domain->remap(inside);
    for (int k = 0; k < 3; k++) {
      // the fluid was given `charged` and the old ledger in full: what it still misses is taken - charged
      if (settle) a[LEDGER + k] = a[TAKEN + k] - a[CHARGED + k];
      x[3 * i + k] = inside[k];
      v[3 * i + k] = atom->v[i][k];
      if (w) w[3 * i + k] = atom->omega[i][k];
      taken[3 * i + k] = a[TAKEN + k];
      ledger[3 * i + k] = a[LEDGER + k];
      a[TAKEN + k] = 0.0;
    }
  }
  if (history_) send_history();
  memcpy(totals, totals_, sizeof totals_);
  if (voidage_send(link_)) stop(voidage_last_error());
}

// What drove the last interval and where it started from, for schemes that learn from it.
void FixVoidage::send_history()
{
  double *kc = (double *)voidage_array(link_, VOIDAGE_LAST_DRAG_COEFFICIENT);
  double *u = (double *)voidage_array(link_, VOIDAGE_LAST_DRIVE_VELOCITY);
  double *f = (double *)voidage_array(link_, VOIDAGE_LAST_FORCE);
  double *v = (double *)voidage_array(link_, VOIDAGE_LAST_VELOCITY);
  if (!kc || !u || !f || !v) stop(voidage_last_error());
  for (int i = 0; i < atom->nlocal; i++) {
    double *a = a_[i];
    kc[i] = a[K];
    for (int k = 0; k < 3; k++) {
      u[3 * i + k] = a[U + k];
      f[3 * i + k] = a[F + k];
      v[3 * i + k] = a[LAST_V + k];
      a[LAST_V + k] = atom->v[i][k];
    }
  }
}

// An array of the drive that was agreed on.
const double *FixVoidage::driven(unsigned name, uint64_t count)
{
  uint64_t n = 0;
  const double *list = (const double *)voidage_read(link_, name, &n);
  if (!list) stop(voidage_last_error());
  if (n != count) stop("the coupler answered for other particles or another exchange");
  return list;
}

void FixVoidage::receive()
{
  const int kind = voidage_receive(link_);
  if (kind == VOIDAGE_STOP) {
    const std::string reason = voidage_stop_reason(link_);
    if (!reason.empty()) host::fail_one(lmp, "fix voidage: the coupled run was stopped: " + reason);
    if (comm->me == 0 && screen) fprintf(screen, "fix voidage: the coupled run is complete at step " BIGINT_FORMAT "\n", update->ntimestep);
    if (comm->me == 0 && logfile) fprintf(logfile, "fix voidage: the coupled run is complete at step " BIGINT_FORMAT "\n", update->ntimestep);
    ended_ = quit_ = true;
    host::end_run(lmp);
    voidage_close(link_);
    link_ = NULL;
    return;
  }
  if (kind < 0) stop(voidage_last_error());
  if (kind != VOIDAGE_DRIVE) stop("an unexpected message came from the coupler");
  const uint64_t n = atom->nlocal;
  uint64_t nk = 0, nu = 0, nf = 0, nc = 0;
  const double *kc = (const double *)voidage_read(link_, VOIDAGE_DRAG_COEFFICIENT, &nk);
  const double *u = (const double *)voidage_read(link_, VOIDAGE_DRIVE_VELOCITY, &nu);
  const double *f = (const double *)voidage_read(link_, VOIDAGE_FORCE, &nf);
  const double *c = (const double *)voidage_read(link_, VOIDAGE_CHARGED, &nc);
  if (!kc || !u || !f || !c) stop(voidage_last_error());
  if (nk != n || nu != 3 * n || nf != 3 * n || nc != 3 * n || voidage_step(link_) != exchange_)
    stop("the coupler answered for other particles or another exchange");
  const double *added = added_sent_ ? driven(VOIDAGE_ADDED_MASS, n) : NULL;
  const double *kw = rotation_ ? driven(VOIDAGE_ROTATION_COEFFICIENT, n) : NULL;
  const double *spin = rotation_ ? driven(VOIDAGE_ROTATION_RATE, 3 * n) : NULL;
  const double *memory = memory_ ? driven(VOIDAGE_MEMORY, memory_ * n) : NULL;
  for (int k = 0; k < 9; k++) totals_[k] = 0.0;
  for (uint64_t i = 0; i < n; i++) {
    double *a = a_[i];
    a[K] = kc[i];
    if (added) a[ADDED] = added[i];
    if (kw) a[SPIN_K] = kw[i];
    if (memory) memcpy(a + COLUMNS, memory + memory_ * i, memory_ * sizeof(double));
    for (int k = 0; k < 3; k++) {
      if (spin) a[SPIN + k] = spin[3 * i + k];
      a[U + k] = u[3 * i + k];
      a[F + k] = f[3 * i + k];
      a[CHARGED + k] = c[3 * i + k];
      totals_[3 + k] += a[CHARGED + k];
      totals_[6 + k] += a[LEDGER + k];
    }
  }
  uint64_t length = 0, flags = 0;
  const char *file = (const char *)voidage_read(link_, VOIDAGE_RESTART_FILE, &length);
  restart_file_.assign(file ? file : "", file ? length : 0);
  const double *flag = file ? (const double *)voidage_read(link_, VOIDAGE_FLAGS, &flags) : NULL;
  last_ = flag && flags > 0 && flag[0] != 0.0;
  voidage_release(link_);
}
