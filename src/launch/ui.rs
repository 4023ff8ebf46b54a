// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the user sees while a run goes: a bar on a terminal, a line now and then elsewhere.
//! Reads the coupler's `@progress` lines (key=value).

use crate::config::Config;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashMap;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

pub struct Ui {
    bar: ProgressBar,
    terminal: bool,
    begin: Instant,
    said: Instant,
    steps: u64,
    end: f64,
    /// reason the coupler gave for a failure
    pub error: Option<String>,
    last: String,
}

impl Ui {
    pub fn new(config: &Config) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::new(config.steps());
        bar.set_draw_target(if terminal {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        });
        let style = "{bar:30} {pos}/{len} steps, {eta} left | {msg}";
        bar.set_style(ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar()));
        let now = Instant::now();
        let (steps, end) = (config.steps(), config.control.end);
        Self { bar, terminal, begin: now, said: now, steps, end, error: None, last: String::new() }
    }

    pub fn line(&mut self, line: &str) {
        if let Some(text) = line.strip_prefix("@error ") {
            self.error = Some(text.replace('\t', "\n"));
        } else if let Some(text) = line.strip_prefix("@warning ") {
            self.say(&format!("warning: {text}"));
        } else if let Some(text) = line.strip_prefix("@summary ") {
            self.last = text.replace('\t', "\n");
        } else if let Some(text) = line.strip_prefix("@progress ") {
            self.progress(&text.split(' ').filter_map(|w| w.split_once('=')).collect());
        }
    }

    fn progress(&mut self, v: &HashMap<&str, &str>) {
        let n = |k: &str| v.get(k).and_then(|x| x.parse::<f64>().ok()).unwrap_or(0.0);
        let step = n("step") as u64;
        let elapsed = self.begin.elapsed().as_secs_f64();
        let total = (n("dem") + n("cfd") + n("coupler")).max(1e-9);
        let share = |k: &str| 100.0 * n(k) / total;
        let text = format!(
            "t = {:.4} of {:.4} s, {:.1} steps/s | DEM {:.0} % CFD {:.0} % coupler {:.1} % | errors: action {:.0e}, solids {:.0e}",
            n("time"),
            self.end,
            n("step") / elapsed.max(1e-9),
            share("dem"),
            share("cfd"),
            share("coupler"),
            n("action"),
            n("solid")
        );
        self.bar.set_position(step);
        self.bar.set_message(text.clone());
        if !self.terminal && (self.said.elapsed() > Duration::from_secs(10) || step == self.steps) {
            self.said = Instant::now();
            self.say(&format!("step {step} of {}: {text}", self.steps));
        }
    }

    #[allow(clippy::print_stderr)] // the terminal is this file's purpose
    fn say(&self, text: &str) {
        if self.terminal { self.bar.println(text) } else { eprintln!("{text}") }
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
        if !self.last.is_empty() {
            self.say(&self.last);
        }
    }
}
