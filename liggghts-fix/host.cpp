// SPDX-License-Identifier: GPL-2.0-or-later
// Into stock LIGGGHTS or LAMMPS: registers the fix without rebuilding it, and refuses a host that does not fit.
//
// One symbol is interposed, the constructor of Modify: it runs the real one, then adds our creator to the
// map of fix styles, private in LIGGGHTS (reached by an explicit template instantiation, which the language allows).

#include "fix_voidage.h"
#include "host.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "group.h"
#include "lammps.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "timer.h"
#include "universe.h"
#include "update.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <malloc.h>
#include <map>
#include <string>

using namespace LAMMPS_NS;

namespace {

typedef Fix *(*Creator)(LAMMPS *, int, char **);
typedef std::map<std::string, Creator> Styles;
template <class Tag, typename Tag::type M> struct Reach { friend typename Tag::type get(Tag) { return M; } };
struct StylesTag { typedef Styles *Modify::*type; friend type get(StylesTag); };
template struct Reach<StylesTag, &Modify::fix_map>;

Fix *create(LAMMPS *lmp, int narg, char **arg) { return new FixVoidage(lmp, narg, arg); }

// Children of this program must not be preloaded too.
__attribute__((constructor)) void loaded() { unsetenv("LD_PRELOAD"); }

// Size glibc gives an object of n bytes.
size_t usable(size_t n) { const size_t s = ((n + 8 + 15) & ~size_t(15)) - 8; return s < 24 ? 24 : s; }

}  // namespace

extern "C" void _ZN9LAMMPS_NS6ModifyC1EPNS_6LAMMPSE(Modify *self, LAMMPS *lmp)
{
  typedef void (*Constructor)(Modify *, LAMMPS *);
  const Constructor real = (Constructor)dlsym(RTLD_NEXT, "_ZN9LAMMPS_NS6ModifyC1EPNS_6LAMMPSE");
  if (!real) {
    fprintf(stderr, "voidage: this program is not %s (no constructor of Modify); use Debian's package %s\n",
            host::program, host::package);
    abort();
  }
  real(self, lmp);
  Styles *styles = self->*get(StylesTag());
  if (styles) (*styles)["voidage"] = &create;
}

// The classes of the running program must be laid out as the headers this fix was compiled with say.
void FixVoidage::check_host()
{
  const struct { const char *name; const void *object; size_t size; } classes[] = {
    {"Atom", atom, sizeof(Atom)}, {"Comm", comm, host::size_of(comm)}, {"Domain", domain, sizeof(Domain)},
    {"Force", force, sizeof(Force)}, {"Group", group, sizeof(Group)}, {"Modify", modify, sizeof(Modify)},
    {"Neighbor", neighbor, sizeof(Neighbor)}, {"Output", output, sizeof(Output)}, {"Timer", timer, sizeof(Timer)},
    {"Update", update, sizeof(Update)}};
  for (size_t i = 0; i < sizeof classes / sizeof *classes; i++) {
    const size_t got = malloc_usable_size(const_cast<void *>(classes[i].object)), want = usable(classes[i].size);
    if (got < classes[i].size || got > want + 16) {
      char text[400];
      snprintf(text, sizeof text, "fix voidage: class %s of this %s has %zu bytes, the fix was built for %zu: "
               "another version is installed; type: ./setup build", classes[i].name, host::program, got, classes[i].size);
      host::fail_all(lmp, text);
    }
  }
}

void FixVoidage::check_settings()
{
  char text[400];
  const double dt = setting("dem.time_step");
  if (fabs(update->dt - dt) > 1e-12 * dt) {
    snprintf(text, sizeof text, "the script's timestep is %.9g s, dem.time_step in case.toml is %.9g s; make them equal",
             update->dt, dt);
    stop(text);
  }
  if (strcmp(update->unit_style, "si") != 0) {
    snprintf(text, sizeof text, "units %s; the coupling works in SI; type: units si", update->unit_style);
    stop(text);
  }
}
