//! Options for sequences that lack something: no odometry, odometry from the reference, no times.

use slam_io::{OdometryChoice, OpenOptions};

/// How to do without a missing piece.
#[derive(Debug, clap::Args)]
pub(crate) struct StandIn {
    /// Odometry: that of the sequence, or none: then path and map have no scale
    #[arg(long, value_enum, value_name = "WHICH", default_value = "found")]
    odometry: OdometryName,
    /// Odometry made from the ground truth with noise: metres and radians per
    /// square root of a second, and a seed, such as 0.02,0.01,1
    #[arg(long, value_name = "SIGMA_V,SIGMA_W,SEED", value_parser = noise, conflicts_with = "odometry")]
    odometry_from_groundtruth: Option<OdometryChoice>,
    /// Seconds to be added to the times of the odometry, where its clock differs
    /// from that of the camera; a run that finds them apart says by how much
    #[arg(long, value_name = "SECONDS", value_parser = offset, allow_hyphen_values = true, default_value = "0")]
    odometry_offset: f64,
    /// Images a second, where there is no times.txt
    #[arg(long, value_name = "HZ", value_parser = rate)]
    fps: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum OdometryName {
    /// That of the sequence
    Found,
    /// None: the images alone tell the path, up to its scale
    None,
}

impl StandIn {
    /// `options` with these.
    pub(crate) fn options(&self, options: OpenOptions) -> OpenOptions {
        OpenOptions {
            odometry: match (self.odometry_from_groundtruth, self.odometry) {
                (Some(choice), _) => choice,
                (None, OdometryName::Found) => OdometryChoice::Found,
                (None, OdometryName::None) => OdometryChoice::Without,
            },
            odometry_offset_s: self.odometry_offset,
            frames_per_second: self.fps,
            ..options
        }
    }
}

fn noise(text: &str) -> Result<OdometryChoice, String> {
    let expected =
        "expected three numbers SIGMA_V,SIGMA_W,SEED, neither sigma negative, such as 0.02,0.01,1";
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let sigma = |text: &str| {
        text.parse::<f64>()
            .ok()
            .filter(|sigma| sigma.is_finite() && *sigma >= 0.0)
    };
    let [v, w, seed] = parts[..] else {
        return Err(expected.to_owned());
    };
    match (sigma(v), sigma(w), seed.parse()) {
        (Some(sigma_v), Some(sigma_w), Ok(seed)) => Ok(OdometryChoice::GroundTruth {
            sigma_v,
            sigma_w,
            seed,
        }),
        _ => Err(expected.to_owned()),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(rate),
        _ => Err("expected a positive number of images a second".to_owned()),
    }
}

fn offset(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(offset) if offset.is_finite() => Ok(offset),
        _ => Err("expected a number of seconds".to_owned()),
    }
}
