// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sweeps that follow each other, several at a time while their rows are in the cache (time skewing, Wonnacott 2000): the next sweep
//! follows the one before at the distance of the furthest neighbour. A row is read from memory once for all of them.
//!
//! Sweep k reads field k mod 2 and writes the other. Two fields are enough for any number of sweeps at a time: what a sweep
//! overwrites, the one before no longer needs. On several threads each has its own rows and stays clear of its neighbours' by
//! one distance more in each sweep; then the gaps between the threads are filled.
//!
//! In a block of hexahedra whose layers do not fit into the cache so many times, each layer is cut into strips, taken one after the
//! other through all layers; a strip moves back by one line from sweep to sweep, so that it needs only what is done.
//!
//! Every row is computed as it is without this: how many sweeps go together does not change a bit.

use super::Active;
use super::active::BLOCK;
use super::graph::Rows;
use super::real::Real;
use super::sweep::{ALONE, OUT, Sweep, cuts};
use crate::threads;
use std::ops::Range;
use std::sync::OnceLock;

/// One sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// adds to what is there (`OUT`), or not (`ALONE`)
    pub add: bool,
    /// as in `Sweep`
    pub factors: [f64; 4],
    /// blocks up to this ring are computed
    pub reach: u16,
    /// blocks beyond and up to this ring are set to zero
    pub zero: u16,
}

/// Blocks that a sweep advances at a time.
const CHUNK: usize = 16;

/// Share of the cache that rows in flight may take.
const SHARE: f64 = 0.9;
/// What a byte from memory costs, in bytes from a neighbouring strip, which are in the third level cache as a rule.
const FAR: f64 = 1.5;
/// What beginning a piece of a strip costs (60 ns), in such bytes.
const PIECE: f64 = 3000.0;

/// How the sweeps go.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plan {
    /// so many at a time
    depth: usize,
    /// pieces of each layer; 1: whole
    strips: usize,
    /// the rows of a group come from far
    fetch: bool,
}

/// Rows and steps of one group.
struct Work<'a, T> {
    rows: &'a Rows<T>,
    active: &'a Active,
    steps: &'a [Step],
    plan: Plan,
}

/// Runs all steps; the result is in field `steps.len()` mod 2.
pub(super) fn run<T: Real>(rows: &Rows<T>, active: &Active, steps: &[Step], fields: [&mut [[T; 8]]; 2]) {
    run_by(plan(rows, active, steps.len()), rows, active, steps, fields);
}

/// By this plan, as far as the threads' rows allow.
fn run_by<T: Real>(plan: Plan, rows: &Rows<T>, active: &Active, steps: &[Step], [a, b]: [&mut [[T; 8]]; 2]) {
    let cuts = cuts(active, steps.len());
    let narrowest = cuts.windows(2).map(|w| w[1] - w[0]).min().unwrap_or(0);
    let lag = lag(rows.width, BLOCK).max(1);
    // gaps of the last sweep must not meet
    let most = if cuts.len() > 2 { narrowest / (2 * lag) } else { usize::MAX };
    let depth = plan.depth.min(most).max(1);
    for (k, group) in steps.chunks(depth).enumerate() {
        let work = Work { rows, active, steps: group, plan };
        if (k * depth).is_multiple_of(2) { work.run(&cuts, a, b) } else { work.run(&cuts, b, a) }
    }
}

/// What moves the fewest bytes into the second level cache and out of it. Of `depth` sweeps, depth + 2 layers (or layers of a strip) are in
/// it. In each group a row is read and written once; in each sweep a strip reads one line of the one before, and overwrites two.
fn plan<T>(rows: &Rows<T>, active: &Active, steps: usize) -> Plan {
    let (n, field) = (rows.d.len(), (8 * size_of::<T>()) as f64);
    let row = 2.0 * field + rows.bytes as f64;
    let (fit, visited) = (SHARE * cache() / row, active.rows_within(steps, n) as f64);
    let (within, layer) = (rows.within as f64, rows.width as f64 * visited / n.max(1) as f64);
    let moved = |groups: usize| FAR * (row + 2.0 * field) * groups as f64 / steps as f64;
    let mut best = Plan { depth: 1, strips: 1, fetch: visited > fit };
    if !best.fetch {
        return best;
    }
    let mut least = moved(steps);
    for groups in 1..steps {
        let depth = steps.div_ceil(groups);
        let wide = fit / (depth + 2) as f64 - 2.0 * within;
        let strips = (rows.width as f64 / wide).ceil() as usize;
        let (cost, strips) = if layer * (depth + 2) as f64 + (depth * CHUNK * BLOCK) as f64 <= fit {
            (moved(groups), 1)
        } else if within > 0.0 && wide > within && strips > 1 {
            (moved(groups) + ((row + field) * within + PIECE) / wide, strips)
        } else {
            continue;
        };
        if cost < least {
            (least, best) = (cost, Plan { depth, strips, ..best });
        }
    }
    best
}

/// Pieces of so many rows that a neighbour may be away.
fn lag(width: usize, rows: usize) -> usize {
    width.div_ceil(rows)
}

/// Bytes of the second level cache of the first core; 1 MB where the system does not tell.
fn cache() -> f64 {
    static SIZE: OnceLock<f64> = OnceLock::new();
    *SIZE.get_or_init(|| {
        let text = std::fs::read_to_string("/sys/devices/system/cpu/cpu0/cache/index2/size");
        let kilobytes = |t: String| t.trim().strip_suffix('K')?.parse::<f64>().ok();
        text.ok().and_then(kilobytes).map_or(1048576.0, |k| 1024.0 * k)
    })
}

impl<T: Real> Work<'_, T> {
    /// All steps; the first reads a.
    fn run(&self, cuts: &[usize], a: &mut [[T; 8]], b: &mut [[T; 8]]) {
        let blocks = cuts[cuts.len() - 1];
        if cuts.len() == 2 {
            return self.skewed(0, [a, b], |_| 0..blocks);
        }
        let lag = lag(self.rows.width, BLOCK);
        if let [step] = self.steps {
            let sweep = self.of(0, a, 0);
            return if step.add { sweep.run::<OUT>(cuts, &[], b) } else { sweep.run::<ALONE>(cuts, &[], b) };
        }
        let rows = a.len();
        let ends = || cuts[1..].iter().map(|c| (c * BLOCK).min(rows));
        let parts = threads::cut(a, ends()).into_iter().zip(threads::cut(b, ends()));
        threads::map(cuts.windows(2).zip(parts).collect(), |(w, (a, b))| {
            let clear = |step: usize| (step + 1) * lag;
            let from = |step| if w[0] == 0 { 0 } else { w[0] + clear(step) };
            let to = |step| if w[1] == blocks { blocks } else { w[1] - clear(step) };
            self.skewed(w[0], [a, b], |step| from(step)..to(step));
        });
        // each gap in as many pieces as keep all threads busy
        let threads = cuts.len() - 1;
        let each = threads.div_ceil(threads - 1);
        for k in 0..self.steps.len() {
            let (now, out) = turn(k, &mut *a, &mut *b);
            let half = (k + 1) * lag;
            let pieces = cuts[1..threads].iter().flat_map(|c| {
                let edge = move |i: usize| c - half + i * 2 * half / each;
                (0..each).map(move |i| edge(i)..edge(i + 1))
            });
            let pieces: Vec<Range<usize>> = pieces.collect();
            let ends = pieces.iter().flat_map(|p| [p.start * BLOCK, (p.end * BLOCK).min(now.len())]);
            let parts = threads::cut(out, ends).into_iter().skip(1).step_by(2);
            threads::map(pieces.iter().zip(parts).collect(), |(p, out)| {
                self.sweep(k, now, 0, p.start * BLOCK, out);
            });
        }
    }

    /// Steps one behind the other on this thread; the fields begin with block `base`, step k takes the blocks of `range(k)`.
    fn skewed(&self, base: usize, [a, b]: [&mut [[T; 8]]; 2], range: impl Fn(usize) -> Range<usize>) {
        let (first, end) = (base * BLOCK, base * BLOCK + a.len());
        let mut go = |k: usize, rows: Range<usize>| {
            let r = range(k);
            let from = rows.start.max(r.start * BLOCK).max(first);
            let to = rows.end.min(r.end * BLOCK).min(end);
            if from < to {
                let (now, out) = turn(k, &mut *a, &mut *b);
                self.sweep(k, now, first, from, &mut out[from - first..to - first]);
            }
        };
        let steps = 0..self.steps.len();
        if self.plan.strips < 2 {
            let chunk = BLOCK * CHUNK;
            let (n, lag) = ((end - first).div_ceil(chunk), lag(self.rows.width, chunk));
            for head in 0..n + lag * (steps.len() - 1) {
                for k in steps.clone() {
                    if let Some(i) = head.checked_sub(k * lag).filter(|i| *i < n) {
                        go(k, first + i * chunk..first + (i + 1) * chunk);
                    }
                }
            }
            return;
        }
        let layer = self.rows.width;
        let (low, high) = (first / layer, end.div_ceil(layer));
        for strip in 0..self.plan.strips {
            // the row where a strip of a layer begins; the first strip begins with the layer, the last ends with it
            let edge = |strip: usize, number: usize, k: usize| {
                let moved = if strip == self.plan.strips { 0 } else { k * self.rows.within };
                number * layer + (strip * layer / self.plan.strips).saturating_sub(moved)
            };
            for head in low..high + steps.len() - 1 {
                for k in steps.clone() {
                    if let Some(number) = head.checked_sub(k).filter(|l| (low..high).contains(l)) {
                        go(k, edge(strip, number, k)..edge(strip + 1, number, k));
                    }
                }
            }
        }
    }

    /// Step k as a sweep; `now` begins with row `base`.
    fn of<'b>(&'b self, k: usize, now: &'b [[T; 8]], base: usize) -> Sweep<'b, T> {
        let Step { factors, reach, zero, .. } = self.steps[k];
        // what the first sweep asked for is near in the others
        let fetch = self.plan.fetch && k == 0;
        Sweep { rows: self.rows, active: self.active, reach, zero, now, base, factors, fetch }
    }

    fn sweep(&self, k: usize, now: &[[T; 8]], base: usize, first: usize, out: &mut [[T; 8]]) {
        let sweep = self.of(k, now, base);
        if self.steps[k].add { sweep.part::<OUT>(first, out) } else { sweep.part::<ALONE>(first, out) }
    }
}

/// What sweep k of a group reads and writes.
fn turn<'a, T>(k: usize, a: &'a mut [[T; 8]], b: &'a mut [[T; 8]]) -> (&'a [[T; 8]], &'a mut [[T; 8]]) {
    if k.is_multiple_of(2) { (a, b) } else { (b, a) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::Made;
    use crate::smooth::{Diffusion, Graph};

    /// However many go together and on however many threads: the bits of one sweep after the other.
    #[test]
    fn sweeps_together_have_the_bits_of_single_ones() {
        let mut stripped = 0;
        for made in [
            Made::graded([9, 7, 90], [0.06, 0.04, 0.5]),
            Made::tet([4, 4, 30], [0.04, 0.04, 0.3]),
            Made::hex([40, 33, 4], [0.4, 0.33, 0.04]),
            Made::graded([9, 200, 7], [0.06, 1.2, 0.05]),
        ] {
            let mesh = made.mesh();
            let graph = Graph::new(&mesh, &Diffusion::uniform(0.012).links(&mesh));
            let occupied: Vec<u32> = (0..mesh.len() as u32).filter(|j| j % 7 == 0 && *j > 900).collect();
            let m = 9;
            let mut active = Active::default();
            active.update(&graph, &occupied, Some(m));
            let step = |k: usize| Step {
                add: k % 3 == 2,
                factors: [0.9, -0.3 / graph.spectrum, 0.0, 0.2],
                reach: k as u16 + 1,
                zero: if k == 0 { m as u16 + 1 } else { 0 },
            };
            let steps: Vec<Step> = (0..m).map(step).collect();
            let of = |(depth, strips): (usize, usize), threads: usize| {
                let mut fields = [vec![[0.0; 8]; mesh.len()], vec![[f64::NAN; 8]; mesh.len()]];
                for j in &occupied {
                    fields[0][graph.row(*j) as usize] = [1.0 + 1e-3 * f64::from(*j); 8];
                }
                let [a, b] = &mut fields;
                let run =
                    || run_by(Plan { depth, strips, fetch: depth > 1 }, &graph.rows, &active, &steps, [a, b]);
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run);
                let [_, b] = fields;
                let seen = |b: &[f64; 8]| b.map(f64::to_bits);
                b.iter().map(seen).collect::<Vec<_>>()
            };
            let one = of((1, 1), 1);
            for (depth, threads) in
                [(2, 1), (3, 1), (5, 1), (9, 1), (20, 1), (1, 2), (2, 2), (3, 2), (4, 3), (9, 4)]
            {
                assert!(of((depth, 1), threads) == one, "{depth} sweeps, {threads} threads");
                for strips in [2, 3].iter().filter(|_| graph.rows.within > 0) {
                    let what = format!("{depth} sweeps, {threads} threads, {strips} strips");
                    assert!(of((depth, *strips), threads) == one, "{what}");
                    stripped += 1;
                }
            }
        }
        assert!(stripped > 0);
    }
}
