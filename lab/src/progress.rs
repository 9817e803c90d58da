//! A progress bar for long work only.
//!
//! The bar appears on standard error after a second, only if that is a terminal, and disappears when the work is done.
//! Generating, loading and measuring share it. If standard error is a file or a pipe, steps of a measurement get a line
//! in place of the bar, one a second at most.

use core::cell::Cell;
use core::fmt;
use core::time::Duration;
use std::io::{self, IsTerminal as _, Read};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::notices::say;

/// The time that work may take before the bar appears.
const PATIENCE: Duration = Duration::from_secs(1);

/// The progress of one piece of work.
pub struct Progress {
    bar: ProgressBar,
    scope: String,
    is_shown: bool,
    /// The time from the start to the last line that was written.
    told: Cell<Duration>,
}

impl Progress {
    /// Starts counting to `total`, in any unit.
    #[must_use]
    pub fn new(what: impl Into<String>, total: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        let template = "{msg:<10} {bar:40} {percent:>3} %, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(what.into());
        Self { bar, scope: String::new(), is_shown: false, told: Cell::default() }
    }

    /// Counts `amount` more. Call it per row or per buffer, not per element.
    pub fn advance(&mut self, amount: u64) {
        self.bar.inc(amount);
        if !self.is_shown && self.bar.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.is_shown = true;
        }
    }

    /// Sets the message: the present piece of work.
    pub fn set_message(&self, what: &str) {
        let message = format!("{}{what}", self.scope);
        if self.has_line(io::stderr().is_terminal()) {
            say(&message);
            self.told.set(self.bar.elapsed());
        }
        self.bar.set_message(message);
    }

    /// Returns true if the step that begins gets a line.
    fn has_line(&self, is_terminal: bool) -> bool {
        !is_terminal && self.bar.elapsed() > self.told.get() + PATIENCE
    }

    /// Sets the words that come before all further messages.
    pub fn set_scope(&mut self, scope: &str) {
        self.scope = format!("{scope}: ");
    }

    /// Returns a reader that counts the bytes it reads.
    pub fn reader<R: Read>(self, inner: R) -> impl Read {
        CountedReader { inner, progress: self }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Progress").field("position", &self.bar.position()).finish_non_exhaustive()
    }
}

struct CountedReader<R> {
    inner: R,
    progress: Progress,
}

impl<R: Read> Read for CountedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.progress.advance(count as u64);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_long_work_have_lines_where_no_bar_is_seen() {
        let mut progress = Progress::new("starting", 3);
        assert!(!progress.has_line(false));
        progress.bar = progress.bar.clone().with_elapsed(2 * PATIENCE);
        assert!(progress.has_line(false) && !progress.has_line(true));
        progress.set_message("first");
        assert!(io::stderr().is_terminal() || !progress.has_line(false));
    }
}
