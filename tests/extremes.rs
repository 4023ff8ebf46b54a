// SPDX-License-Identifier: MIT OR Apache-2.0
//! A part of the map of `docs/schemes.md` in every test run: the corners and the middle of x = Δt/τ_p, mass loading
//! and cell size; what is claimed of each scheme there.

use voidage::scheme::testbench::{Mode, Row, survey};

fn map() -> Vec<Row> {
    survey(&[1e-3, 1.0, 1e6], &[1e-3, 1.0, 1e5], &[0.25, 20.0], |_| {})
}

#[test]
fn the_default_is_stable_and_right_when_steady_and_others_have_the_limits_stated() {
    let rows = map();
    let of = |name: &'static str| rows.iter().filter(move |r| r.point.scheme.name() == name);
    let at = |r: &Row| {
        format!(
            "{:?} x {:e} loading {:e} cell {}",
            r.point.mode, r.point.ratio, r.point.loading, r.point.cell
        )
    };
    for r in of("conservative") {
        assert!(r.outcome.stable, "unstable: {} {:?}", at(r), r.outcome);
        if !r.outcome.steady.is_nan() {
            assert!(r.outcome.steady < 1e-6, "steady drag: {} {:?}", at(r), r.outcome);
        }
    }
    for r in of("conservative") {
        // relative to what the fluid's equation adds up: rounding alone, however small the slip
        assert!(r.outcome.third_law_terms < 1e-12, "third law: {} {:?}", at(r), r.outcome);
    }
    // R: explicit coupling fails near Δt ≈ τ_f = τ_p/loading
    for r in of("explicit").filter(|r| r.point.mode == Mode::Held) {
        let fluid = r.point.ratio * r.point.loading;
        assert_eq!(r.outcome.stable, fluid < 0.5, "explicit: {} {:?}", at(r), r.outcome);
    }
    // without a ledger the third law is broken wherever particles respond within a step
    let worst = |name| of(name).map(|r| r.outcome.third_law).fold(0.0, f64::max);
    assert!(worst("implicit") > 0.1 && worst("split") > 0.1 && worst("implicit-filled") > 0.1);
    // the adaptive scheme: exact for settling particles where the default lags
    let settling = |name| {
        of(name)
            .filter(|r| r.point.mode == Mode::Settling && r.point.ratio > 100.0)
            .map(|r| r.outcome.transient)
            .fold(0.0, f64::max)
    };
    assert!(settling("conservative-adaptive") < 1e-2 && settling("conservative") > 0.3);
}
