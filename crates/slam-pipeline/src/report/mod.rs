//! The report page.
pub mod plot;
use crate::record::RunRecord;

/// The name of the run; sections follow.
pub fn render_html(run: &RunRecord) -> String {
    run.sequence.clone()
}
