//! Rows of odometry and where they came from.

use std::fmt::{self, Write as _};
use std::path::PathBuf;

use mono_geometry::motion::OdometrySample;

/// One row: it holds from its time to the next row's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryRow {
    /// Time from which the row holds, seconds.
    pub t_s: f64,
    /// Forward speed, m/s.
    pub v_mps: f64,
    /// Turn rate about the body's z axis (left positive), rad/s.
    pub omega_radps: f64,
}

impl From<OdometryRow> for OdometrySample {
    fn from(row: OdometryRow) -> Self {
        Self {
            t_s: row.t_s,
            v_mps: row.v_mps,
            omega_radps: row.omega_radps,
        }
    }
}

/// Odometry and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Rows, times strictly increasing.
    pub rows: Vec<OdometryRow>,
    /// Where they came from.
    pub source: OdometrySource,
    /// The file that holds exactly these rows in the native form, if there is one.
    pub(crate) file: Option<PathBuf>,
}

impl Odometry {
    /// The same with `offset_s` added to the times. A first row that then comes after the first frame is held back to it.
    pub(crate) fn later(mut self, offset_s: f64, first_frame_s: f64) -> Self {
        for row in &mut self.rows {
            row.t_s += offset_s;
        }
        if let Some(first) = self.rows.first_mut() {
            first.t_s = first.t_s.min(first_frame_s);
        }
        // The file has the times as they were.
        self.file = None;
        self
    }
}

/// Where the odometry of a sequence came from.
#[derive(Debug, Clone, PartialEq)]
pub enum OdometrySource {
    /// Speeds and turn rates of a file, named relative to the sequence.
    File(String),
    /// Counts of wheel encoders.
    Wheels,
    /// Speed and steering angle.
    Steering,
    /// Messages of a topic of a recorded log.
    Topic(String),
    /// Differences of the reference's poses with noise.
    GroundTruth {
        /// Noise of the speed, m/s per square root of a hertz.
        sigma_v: f64,
        /// Noise of the turn rate, rad/s per square root of a hertz.
        sigma_w: f64,
        /// Seed of the noise.
        seed: u64,
    },
    /// There is none: the motion is found from the images alone, up to scale.
    None,
}

impl fmt::Display for OdometrySource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OdometrySource::File(name) => formatter.write_str(name),
            OdometrySource::Wheels => formatter.write_str("wheel encoders"),
            OdometrySource::Steering => formatter.write_str("speed and steering angle"),
            OdometrySource::Topic(topic) => write!(formatter, "topic {topic}"),
            OdometrySource::GroundTruth {
                sigma_v,
                sigma_w,
                seed,
            } => write!(
                formatter,
                "ground truth with noise of {sigma_v} and {sigma_w}, seed {seed}"
            ),
            OdometrySource::None => formatter.write_str("none"),
        }
    }
}

/// The text of the rows in the native form; it reads back to the same bits.
#[must_use]
pub fn odometry_csv(rows: &[OdometryRow]) -> String {
    let mut text = String::from("t_s,v_mps,omega_radps\n");
    for row in rows {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{},{},{}", row.t_s, row.v_mps, row.omega_radps);
    }
    text
}

/// Median of the steps between ascending times, seconds; `None` for fewer than two. O(n).
pub(super) fn usual_interval_s(times_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return None;
    }
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_moves_every_row_and_holds_the_first_back() {
        let row = |t_s: f64| OdometryRow {
            t_s,
            v_mps: t_s,
            omega_radps: 0.0,
        };
        let odometry = Odometry {
            rows: vec![row(0.0), row(0.1), row(0.2)],
            source: OdometrySource::Wheels,
            file: Some(PathBuf::from("odometry.csv")),
        };
        let times = |offset_s: f64| {
            let moved = odometry.clone().later(offset_s, 0.0);
            assert_eq!(moved.file, None);
            moved.rows.iter().map(|row| row.t_s).collect::<Vec<_>>()
        };
        assert_eq!(times(-0.5), [-0.5, -0.4, -0.3]);
        assert_eq!(times(0.5), [0.0, 0.6, 0.7]);
    }
}
