// SPDX-License-Identifier: MIT OR Apache-2.0
//! The size of a recording before it is made, from numbers of particles and cells and from what the messages carry.
//! Upper bound: without compression.

use super::Selection;
use crate::config::{Config, foam, script};
use crate::setup;

/// What will be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// exchanges recorded
    pub exchanges: u64,
    /// bytes of one exchange
    pub exchange: u64,
    /// bytes carried into an exchange whose predecessor is not recorded
    pub state: u64,
    /// bytes in all
    pub total: u64,
}

/// Recorded exchanges, and how many of them need a state.
fn count(s: &Selection) -> (u64, u64) {
    let (mut n, mut states, mut last) = (0, 0, false);
    for k in 0..=s.steps as i64 {
        let takes = s.takes(k);
        n += u64::from(takes);
        states += u64::from(takes && !last && k > 0);
        last = takes;
    }
    (n, states)
}

/// Of a run with so many particles and cells.
pub fn of(c: &Config, particles: u64, cells: u64) -> Forecast {
    let told = setup::welcome(c, None).settings;
    let on = |key: &str| u64::from(told.get(key).is_some_and(|v| *v > 0.0));
    let memory = told.get("drive.memory").map_or(0, |w| *w as u64);
    // id, x, v, r, m, impulse, ledger, and what is asked for
    let sent = 1
        + 3
        + 3
        + 1
        + 1
        + 3
        + 3
        + 10 * on("send.history")
        + on("send.type")
        + 3 * on("send.angular_velocity");
    // K, u, f, charged, and the rest
    let back = 1 + 3 + 3 + 3 + on("drive.added_mass") + 4 * on("drive.rotation");
    let particle = 8 * (sent + back + 2 * memory);
    // U and what is sent beside; ε, ε old, Sp, Su, ε_s U_s back
    let cell = 8
        * (3 + 3 * on("send.pressure_gradient")
            + 3 * on("send.stress_divergence")
            + 6
            + 3 * on("fluid.continuity"));
    let (exchanges, states) = count(&Selection::of(c));
    let exchange = particles * particle + cells * cell + 1000;
    let state = 8 * 7 * cells;
    // hexahedra: 3 faces of 4 corners and a point per cell are 25 words; walls add to small meshes, other cells have more
    let mesh = cells * 8 * 40 + 10_000;
    let rows = 250 * (c.steps() + 1);
    Forecast { exchanges, exchange, state, total: mesh + rows + exchanges * exchange + states * state }
}

/// Of a case, as far as its files tell; the error says what they do not.
pub fn forecast(c: &Config) -> Result<Forecast, String> {
    let cells = foam::extent(&c.fluid_case()).and_then(|e| e.cells);
    let cells =
        cells.ok_or("the number of cells is in neither constant/polyMesh/owner nor system/blockMeshDict")?;
    let s = script::read(&c.script(), &c.file.dem.variables)?;
    let n = s.count.or(s.placed).ok_or("the script reads no data file that tells the number of particles")?;
    Ok(of(c, n as u64, cells as u64))
}

/// "3.2 GB".
pub fn bytes(n: u64) -> String {
    let units = ["B", "kB", "MB", "GB", "TB", "PB"];
    let (mut x, mut i) = (n as f64, 0);
    while x >= 1000.0 && i + 1 < units.len() {
        (x, i) = (x / 1000.0, i + 1);
    }
    format!("{x:.*} {}", usize::from(i > 0 && x < 100.0), units[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selections_count_exchanges_and_states() {
        let s = Selection { every: 10, first: 3, last: 2, steps: 100 };
        let taken: Vec<i64> = (0..=100).filter(|k| s.takes(*k)).collect();
        assert_eq!(taken, [0, 1, 2, 10, 20, 30, 40, 50, 60, 70, 80, 90, 99, 100]);
        assert_eq!(count(&s), (14, 10));
        assert_eq!(count(&Selection { every: 1, ..s }), (101, 0));
        assert!(!Selection { every: 0, first: 0, last: 0, steps: 100 }.any());
    }

    #[test]
    fn sizes_read_as_people_write_them() {
        assert_eq!(bytes(999), "999 B");
        assert_eq!(bytes(5_130_000_000), "5.1 GB");
    }
}
