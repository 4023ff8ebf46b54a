// SPDX-License-Identifier: MIT OR Apache-2.0
//! What an exchange does to the run: the voidage of the cells, the force on the particles and the momentum source of the
//! fluid, formed from the replies as the two programs form them.
//!
//! Reads an exchange of a replay; writes ε by cell slot, K (u − v) + f (N) by particle id, Su − Sp U (N/m3) by cell slot, U
//! the recorded fluid at the end of the step. Two replays are set side by side with `compare::Difference`. Does not know
//! settings.

use super::RecordError;
use super::compare::Difference;
use super::replay::Exchanged;
use serde::Serialize;

/// One exchange; three numbers per particle and per cell in `force` and `source`.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// exchange
    pub k: i64,
    /// ε
    pub voidage: Vec<f64>,
    /// N; empty where the DEM got no reply (the last exchange of a run)
    pub force: Vec<f64>,
    /// N/m3
    pub source: Vec<f64>,
}

impl Effect {
    /// Of the replies of the replay.
    pub fn of(x: &Exchanged) -> Result<Self, RecordError> {
        let p = x.anew.particles()?;
        let (drive, sources) = (x.anew.drive(&p)?, x.anew.sources(x.mesh)?);
        let force = (0..drive.drag_coefficient.len()).flat_map(|i| {
            let (k, u, f) = (drive.drag_coefficient[i], drive.velocity[i], drive.force[i]);
            [0, 1, 2].map(|a| k * (u[a] - p.velocity[i][a]) + f[a])
        });
        let fluid = &x.fluid.velocity;
        let source = (0..x.mesh.len())
            .flat_map(|j| [0, 1, 2].map(|a| sources.su[j][a] - sources.sp[j] * fluid[j][a]))
            .collect();
        Ok(Self { k: x.k, force: force.collect(), source, voidage: sources.voidage })
    }
}

/// Relative errors of one quantity; 0/0 = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Error {
    /// √(Σ difference² / Σ reference²)
    pub l2: f64,
    /// largest difference / largest reference value
    pub max: f64,
}

/// Errors of the three quantities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// of ε
    pub voidage: Error,
    /// of the force on the particles
    pub force: Error,
    /// of the momentum source
    pub source: Error,
}

/// Differences of two replays, exchange by exchange.
#[derive(Clone, Debug, Default)]
pub struct Gap([Difference; 3]);

impl Gap {
    /// Adds an exchange; `due` is the reference.
    pub fn add(&mut self, got: &Effect, due: &Effect) -> Result<(), RecordError> {
        let lengths = |e: &Effect| (e.k, e.voidage.len(), e.force.len(), e.source.len());
        if lengths(got) != lengths(due) {
            let what = "other cells or particles than the reference".into();
            return Err(RecordError::Content { k: got.k, what });
        }
        let pairs = [(&got.voidage, &due.voidage), (&got.force, &due.force), (&got.source, &due.source)];
        for (sum, (a, b)) in self.0.iter_mut().zip(pairs) {
            sum.add(a, b, got.k, |i| i as i64);
        }
        Ok(())
    }
    /// Over all exchanges added.
    pub fn errors(&self) -> Errors {
        let [voidage, force, source] =
            [0, 1, 2].map(|i| Error { l2: self.0[i].relative(), max: self.0[i].relative_largest() });
        Errors { voidage, force, source }
    }
}

impl Errors {
    /// The largest of the three L2 errors.
    pub fn l2(&self) -> f64 {
        [self.force, self.source].iter().fold(self.voidage.l2, |m, e| m.max(e.l2))
    }
    /// The largest of the three maximum errors.
    pub fn max(&self) -> f64 {
        [self.force, self.source].iter().fold(self.voidage.max, |m, e| m.max(e.max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_the_numbers() {
        let due = Effect { k: 3, voidage: vec![0.6, 0.8], force: vec![3.0, 4.0, 0.0], source: vec![0.0; 6] };
        let mut got = due.clone();
        (got.voidage[1], got.force[0]) = (0.9, 3.5);
        let mut gap = Gap::default();
        gap.add(&got, &due).unwrap();
        let e = gap.errors();
        assert!((e.voidage.l2 - 0.1).abs() < 1e-12 && (e.voidage.max - 0.125).abs() < 1e-12, "{e:?}");
        assert!((e.force.l2 - 0.1).abs() < 1e-12 && (e.force.max - 0.125).abs() < 1e-12, "{e:?}");
        assert_eq!(e.source, Error::default());
        assert!((e.l2() - 0.1).abs() < 1e-12);
        got.force.clear();
        assert!(gap.add(&got, &due).is_err());
    }
}
