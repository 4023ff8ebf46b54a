// SPDX-License-Identifier: MIT OR Apache-2.0
//! Curves in a frame, as SVG.
//!
//! Reads names, labels and numbers; writes text. Knows nothing of where they come from.

use std::fmt::Write;

const SIZE: [f64; 2] = [560.0, 340.0];
const LEFT: f64 = 64.0;
const TOP: f64 = 40.0;
/// Told apart by eyes that see colours differently (Okabe & Ito).
pub const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999"];

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// what it shows, with unit
    pub label: String,
    /// decades
    pub logarithmic: bool,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// in the legend
    pub name: String,
    /// (x, y)
    pub points: Vec<(f64, f64)>,
}

/// Curves in a frame.
#[derive(Clone, Debug)]
pub struct Chart {
    /// above
    pub title: String,
    /// horizontal
    pub x: Axis,
    /// vertical
    pub y: Axis,
    /// what is drawn
    pub curves: Vec<Curve>,
    /// horizontal lines: name and y
    pub lines: Vec<(String, f64)>,
    /// vertical lines: name and x
    pub marks: Vec<(String, f64)>,
}

/// An axis with its range, as drawn.
struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
    ticks: Vec<f64>,
}

impl Scale {
    fn new(axis: &Axis, values: impl Iterator<Item = f64>) -> Self {
        let logarithmic = axis.logarithmic;
        let fit = values.filter(|v| v.is_finite() && (!logarithmic || *v > 0.0));
        let (mut low, mut high) =
            fit.fold((f64::INFINITY, f64::NEG_INFINITY), |r, v| (r.0.min(v), r.1.max(v)));
        if low > high {
            (low, high) = if logarithmic { (1.0, 10.0) } else { (0.0, 1.0) };
        }
        if logarithmic {
            let d = [low.log10().floor() as i32, high.log10().ceil() as i32];
            let d = [d[0], d[1].max(d[0] + 1)];
            let each = ((d[1] - d[0]) / 8 + 1) as usize;
            let ticks = (d[0]..=d[1]).step_by(each).map(|e| 10f64.powi(e)).collect();
            return Self { low: 10f64.powi(d[0]), high: 10f64.powi(d[1]), logarithmic, ticks };
        }
        if high <= low {
            (low, high) = (low - 0.5 * low.abs().max(1.0), high + 0.5 * high.abs().max(1.0));
        }
        // steps of 1, 2 or 5 times a power of ten
        let raw = (high - low) / 6.0;
        let power = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= raw).unwrap_or(raw);
        let (first, last) = ((low / step).floor() as i64, (high / step).ceil() as i64);
        let ticks = (first..=last).map(|i| i as f64 * step).collect();
        Self { low: first as f64 * step, high: last as f64 * step, logarithmic, ticks }
    }
    /// 0 at the low end, 1 at the high one.
    fn at(&self, v: f64) -> f64 {
        let f = |x: f64| if self.logarithmic { x.log10() } else { x };
        (f(v) - f(self.low)) / (f(self.high) - f(self.low))
    }
    /// A tick's number.
    fn label(&self, v: f64) -> String {
        if self.logarithmic && v != 1.0 { format!("1e{}", v.log10().round()) } else { Self::text(v) }
    }
    fn text(v: f64) -> String {
        let short = format!("{v:.4}");
        let short = short.trim_end_matches('0').trim_end_matches('.');
        if v == 0.0 || (1e-3..1e5).contains(&v.abs()) {
            short.into()
        } else {
            format!("{v:.1e}").replace(".0e", "e")
        }
    }
}

/// For text between tags.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Chart {
    /// The picture.
    pub fn svg(&self) -> String {
        let all = || self.curves.iter().flat_map(|c| &c.points);
        let x = Scale::new(&self.x, all().map(|p| p.0));
        let y = Scale::new(&self.y, all().map(|p| p.1).chain(self.lines.iter().map(|l| l.1)));
        let px = |v: f64| LEFT + x.at(v) * SIZE[0];
        let py = |v: f64| TOP + (1.0 - y.at(v)) * SIZE[1];
        let (right, bottom) = (LEFT + SIZE[0], TOP + SIZE[1]);
        let longest = self.curves.iter().map(|c| c.name.chars().count()).max().unwrap_or(0);
        let columns = if longest > 28 { 2 } else { 3 };
        let rows = self.curves.len().div_ceil(columns);
        let (width, height) = (right + 20.0, bottom + 56.0 + 18.0 * rows as f64);
        let mut s = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{LEFT}\" y=\"18\" font-size=\"13\">{}</text>\n",
            escape(&self.title)
        );
        for t in &x.ticks {
            let p = px(*t);
            let _ = writeln!(
                s,
                "<path d=\"M{p:.1} {TOP}V{bottom}\" stroke=\"#ddd\"/><text x=\"{p:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 15.0,
                x.label(*t)
            );
        }
        for t in &y.ticks {
            let p = py(*t);
            let _ = writeln!(
                s,
                "<path d=\"M{LEFT} {p:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 5.0,
                p + 4.0,
                y.label(*t)
            );
        }
        let _ = writeln!(
            s,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n<text transform=\"translate(14 {}) rotate(-90)\" \
             text-anchor=\"middle\">{}</text>",
            LEFT + 0.5 * SIZE[0],
            bottom + 32.0,
            escape(&self.x.label),
            TOP + 0.5 * SIZE[1],
            escape(&self.y.label)
        );
        for (_, at) in &self.lines {
            let _ = writeln!(s, "<path d=\"M{LEFT} {0:.1}H{right}\" stroke=\"#000\"/>", py(*at));
        }
        let inside = self.marks.iter().filter(|m| m.1 >= x.low && m.1 <= x.high);
        for (i, (name, at)) in inside.enumerate() {
            let _ = writeln!(
                s,
                "<path d=\"M{0:.1} {TOP}V{bottom}\" stroke=\"#000\" stroke-dasharray=\"4 3\"/><text x=\"{1:.1}\" y=\"{2}\">{3}</text>",
                px(*at),
                px(*at) + 3.0,
                TOP + 12.0 + 13.0 * (i % 4) as f64,
                escape(name)
            );
        }
        for (i, c) in self.curves.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let points: Vec<String> = c
                .points
                .iter()
                .filter(|p| p.0.is_finite() && p.1.is_finite())
                .map(|p| format!("{:.1},{:.1}", px(p.0), py(p.1)))
                .collect();
            let _ = writeln!(
                s,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
                points.join(" ")
            );
            let (lx, ly) = (
                LEFT + SIZE[0] / columns as f64 * (i % columns) as f64,
                bottom + 52.0 + 18.0 * (i / columns) as f64,
            );
            let _ = writeln!(
                s,
                "<path d=\"M{lx} {0}h18\" stroke=\"{colour}\" stroke-width=\"2\"/><text x=\"{1}\" y=\"{ly}\">{2}</text>",
                ly - 4.0,
                lx + 23.0,
                escape(&c.name)
            );
        }
        s + "</svg>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_lie_in_the_frame() {
        let chart = |logarithmic, points: Vec<(f64, f64)>| Chart {
            title: "a < b".into(),
            x: Axis { label: "x".into(), logarithmic },
            y: Axis { label: "y".into(), logarithmic },
            curves: vec![Curve { name: "one".into(), points }],
            lines: vec![("1".into(), 1.0)],
            marks: vec![("far".into(), 1e9)],
        };
        for (log, points) in
            [(true, vec![(1e-4, 0.02), (3.0, 50.0)]), (false, vec![(-3.0, 2.0), (4.5, -7.0)]), (true, vec![])]
        {
            let s = chart(log, points).svg();
            assert!(
                s.contains("a &lt; b") && !s.contains("NaN") && !s.contains("inf") && !s.contains("far"),
                "{s}"
            );
            let line = s.lines().find(|l| l.starts_with("<polyline")).unwrap();
            let numbers = line.split('"').nth(1).unwrap();
            for p in numbers.split(' ').filter(|p| !p.is_empty()) {
                let (x, y) = p.split_once(',').unwrap();
                let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                assert!((LEFT..=LEFT + SIZE[0]).contains(&x) && (TOP..=TOP + SIZE[1]).contains(&y));
            }
        }
        assert_eq!([0.0, 0.25, 1e-7, 20.0].map(Scale::text), ["0", "0.25", "1e-7", "20"]);
        assert_eq!(Scale::text(1.5e-8), "1.5e-8");
    }
}
