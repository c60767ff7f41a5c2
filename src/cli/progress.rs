//! How far long work is: a bar where stderr is a terminal, a plain line every few seconds where it is not.

use super::output::note_line;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between two plain lines.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// One piece of work with a known number of steps. Shown on stderr only, so that stdout stays for answers.
pub struct Progress {
    label: String,
    shown: Shown,
}

enum Shown {
    Bar(ProgressBar),
    Lines(Mutex<Lines>),
}

struct Lines {
    done: usize,
    total: usize,
    began: Instant,
    printed: Instant,
}

impl Progress {
    /// Begins: `label` says what is counted.
    pub fn new(label: &str, total: usize) -> Self {
        let shown = if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(total as u64);
            // The template is a literal, so parsing it cannot fail; the default style is a fair substitute if it did.
            if let Ok(style) =
                ProgressStyle::with_template("{msg:<18} {bar:32} {pos}/{len} {elapsed} (eta {eta})")
            {
                bar.set_style(style);
            }
            bar.set_message(label.to_owned());
            Shown::Bar(bar)
        } else {
            let now = Instant::now();
            Shown::Lines(Mutex::new(Lines {
                done: 0,
                total,
                began: now,
                printed: now,
            }))
        };
        Self {
            label: label.to_owned(),
            shown,
        }
    }

    /// Begins where stderr is a terminal; elsewhere nothing is shown.
    pub fn at_terminal(label: &str, total: usize) -> Option<Self> {
        std::io::stderr().is_terminal().then(|| Self::new(label, total))
    }

    /// Takes the bar off the screen while something else is printed.
    pub fn suspended<T>(progress: Option<&Self>, print: impl FnOnce() -> T) -> T {
        match progress.map(|p| &p.shown) {
            Some(Shown::Bar(bar)) => bar.suspend(print),
            _ => print(),
        }
    }

    /// Ends without a line about the whole.
    pub fn clear(self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }

    /// One more is done. May be called from any thread.
    pub fn tick(&self) {
        match &self.shown {
            Shown::Bar(bar) => bar.inc(1),
            Shown::Lines(lines) => {
                // A panic of another thread cannot leave these numbers half written.
                let mut lines = lines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                lines.done += 1;
                self.print_if_due(&mut lines);
            }
        }
    }

    /// `done` of `total` are done, where the work counts for itself.
    pub fn set(&self, done: usize, total: usize) {
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_length(total as u64);
                bar.set_position(done as u64);
            }
            Shown::Lines(lines) => {
                let mut lines = lines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                lines.done = lines.done.max(done);
                lines.total = total;
                self.print_if_due(&mut lines);
            }
        }
    }

    fn print_if_due(&self, lines: &mut Lines) {
        if lines.printed.elapsed() >= LINE_EVERY {
            lines.printed = Instant::now();
            self.print(lines);
        }
    }

    fn print(&self, lines: &Lines) {
        let (done, total) = (lines.done, lines.total);
        note_line!(
            "{}: {done} of {total}, {:.0} s",
            self.label,
            lines.began.elapsed().as_secs_f64()
        );
    }

    /// Ends: takes a bar off the screen and leaves one line about the whole.
    pub fn finish(self) {
        match &self.shown {
            Shown::Bar(bar) => {
                let (done, seconds) = (bar.position(), bar.elapsed().as_secs_f64());
                bar.finish_and_clear();
                note_line!("{}: {done}, {seconds:.1} s", self.label);
            }
            Shown::Lines(lines) => {
                let lines = lines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                note_line!(
                    "{}: {}, {:.1} s",
                    self.label,
                    lines.done,
                    lines.began.elapsed().as_secs_f64()
                );
            }
        }
    }
}
