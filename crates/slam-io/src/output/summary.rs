//! `summary.json`: every figure of a run in one place.

use serde::Serialize;

use super::error::OutputError;
use crate::figures::{RunFigures, run_figures};
use crate::record::{RunRecord, RunScale, SmootherRecord};
use crate::warning::Warning;

/// The bytes of the file.
pub(super) fn summary_json(run: &RunRecord) -> Result<Vec<u8>, OutputError> {
    #[derive(Serialize)]
    struct Summary<'a> {
        sequence: &'a str,
        version: &'static str,
        method: &'a str,
        particles: usize,
        seed: u64,
        scale: RunScale,
        warnings: &'a [Warning],
        figures: RunFigures,
        smoother: Option<&'a SmootherRecord>,
        configuration: &'a str,
    }
    let summary = Summary {
        sequence: &run.sequence,
        version: env!("CARGO_PKG_VERSION"),
        method: &run.method,
        particles: run.particles,
        seed: run.seed,
        scale: run.scale,
        warnings: &run.warnings,
        figures: run_figures(run),
        smoother: run.smoother.as_ref(),
        configuration: &run.configuration,
    };
    let mut bytes = serde_json::to_vec_pretty(&summary).map_err(OutputError::encoding)?;
    bytes.push(b'\n');
    Ok(bytes)
}
