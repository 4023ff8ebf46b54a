// SPDX-License-Identifier: GPL-2.0-or-later
// fix voidage: the particle side of the coupling. Reads drag coefficient K (kg/s), driving velocity u (m/s),
// force F (N) and charged impulse (N s) per particle from the coupler, and if asked for K_w (N m s) and W (rad/s) of a
// torque; writes position, velocity, size, mass, the impulse really taken and the ledger. Applies K (u - v) + F and
// K_w (W - w) in every DEM step. Knows no fluid.
//
//   fix ID all voidage
#ifndef VOIDAGE_FIX_H
#define VOIDAGE_FIX_H

#include "fix.h"
#include "voidage.h"
#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixVoidage : public Fix {
 public:
  FixVoidage(class LAMMPS *, int, char **);
  ~FixVoidage();
  int setmask();
  void init();
  void setup(int);
  void post_force(int);
  void end_of_step();
  void post_run();
  double compute_vector(int);
  double memory_usage();

  void grow_arrays(int);
  void copy_arrays(int, int, int);
  void set_arrays(int);
  int pack_exchange(int, double *);
  int unpack_exchange(int, double *);

  void write_restart(FILE *);
  void restart(char *);
  int pack_restart(int, double *);
  void unpack_restart(int, int);
  int size_restart(int);
  int maxsize_restart();

 private:
  // columns of the per-atom table
  enum { K, U, F = U + 3, CHARGED = F + 3, TAKEN = CHARGED + 3, LEDGER = TAKEN + 3, FORCE = LEDGER + 3,
         HELD = FORCE + 3,  // force and torque of all kinds when a restart file is written
         LAST_V = HELD + 6, ADDED = LAST_V + 3, SPIN_K = ADDED + 1, SPIN = SPIN_K + 1, TORQUE = SPIN + 3,
         COLUMNS = TORQUE + 3 };  // behind them what the coupler remembers of the particle, `memory_` wide

  voidage_link *link_;
  double **a_;                 // per atom, `width_` wide
  int width_, memory_;         // columns of the table; those at its end the coupler wants to have back
  int rows_;                   // rows of the table
  bigint first_step_;          // DEM step of exchange 0, -1: not yet
  bigint step_;                // last one done: when the program ends, `update` goes before its fixes
  bigint exchange_;            // number of the last exchange
  bigint restored_;            // exchange a restart file brought back, -1: none
  std::string restart_file_;   // to be written in this exchange, else empty
  bool last_;                  // that is the last exchange of the run
  int interval_;               // DEM steps between exchanges
  double explicit_limit_;      // largest K dt / m handled explicitly
  double added_;               // C_a times fluid density (kg/m3): added mass per particle volume
  bool history_;               // the scheme wants to know the last interval
  bool types_, spins_;         // types and angular velocities are to be sent
  bool added_sent_, rotation_; // the added mass of each particle comes with the drive; a torque too
  bool constant_force_;        // force of the exchange held over the interval
  bool ended_;                 // the coupler has ended the run: no fluid force any more
  bool quit_;                  // this `run` is being ended
  int runs_after_;             // `run`s begun after the end
  int integrated_, frozen_;    // group bits
  double totals_[9];           // this rank: impulse taken, charged, old ledger (N s)

  void check_host();
  void check_settings();
  double setting(const char *);
  void open();
  void exchange();
  void send(bool settle);
  void send_history();
  void receive();
  void resume(bigint first);
  void run_after_end();
  void save();
  void fluid_force(int i, double h, double *fd) const;
  void fluid_torque(int i, double h, double *td) const;
  bool moves(int i) const;
  void widen(int memory);
  const double *driven(unsigned name, uint64_t count);
  void stop(const char *);
};

}  // namespace LAMMPS_NS

#endif
