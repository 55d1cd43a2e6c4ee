//! `mono-slam eval`: absolute and relative trajectory error, as `evo` computes them.

use std::path::{Path, PathBuf};

use slam_io::{Trajectory, read_trajectory};
use trajectory_eval::{Alignment, EvaluationError, Matching, absolute_error_of, relative_error_of};

use super::eval_text::{Compared, as_json, as_table, as_text};
use super::threshold::{check_ate, metres, positive_seconds, seconds, whole};
use crate::failure::{Failure, print, remark};

/// Arguments of `mono-slam eval`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A trajectory is a file of lines `t x y z qx qy qz qw` (TUM), of positions `t x y z`, or a table whose header \
    names its columns, as EuRoC's and TUM-VI's data.csv. NaN lines are left out, quaternions normalised; notes say so."
)]
pub(crate) struct Arguments {
    /// Estimated trajectories: TUM format, or a table with a header
    #[arg(value_name = "ESTIMATE", required = true)]
    estimates: Vec<PathBuf>,
    /// Reference trajectory
    #[arg(value_name = "REFERENCE", required = true)]
    reference: PathBuf,
    /// Motion to remove from the estimate before errors are taken
    #[arg(long, value_enum, default_value_t = Align::None)]
    align: Align,
    /// Frames from one end of a relative step to the other
    #[arg(long, value_name = "FRAMES", default_value_t = 1, value_parser = whole::<usize>)]
    delta: usize,
    /// Largest difference in time of two poses that are compared
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01, value_parser = positive_seconds)]
    max_time_difference: f64,
    /// Added to the times of the estimates before they are compared
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    time_offset: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Exit with code 3 when the absolute error (RMSE of position) is larger
    #[arg(long, value_name = "METRES", value_parser = metres)]
    max_ate: Option<f64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Align {
    /// Nothing
    None,
    /// One rotation about z through the start: the first heading of the reference is free
    Heading,
    /// Rotation about z and translation in the plane
    Se2,
    /// Rotation about z, translation in the plane and scale
    Sim2,
    /// Rotation and translation
    Se3,
    /// Rotation, translation and scale
    Sim3,
}

impl From<Align> for Alignment {
    fn from(align: Align) -> Self {
        match align {
            Align::None => Alignment::None,
            Align::Heading => Alignment::Heading,
            Align::Se2 => Alignment::Se2,
            Align::Sim2 => Alignment::Sim2,
            Align::Se3 => Alignment::Se3,
            Align::Sim3 => Alignment::Sim3,
        }
    }
}

/// Compares, prints, judges.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.delta == 0 {
        return Err(Failure::input(
            "--delta: a relative step goes over at least 1 frame".to_owned(),
        ));
    }
    let reference = noted(&arguments.reference)?;
    let compared = arguments
        .estimates
        .iter()
        .map(|path| compare(arguments, path, &reference))
        .collect::<Result<Vec<_>, _>>()?;
    let alignment = Alignment::from(arguments.align);
    print(&match compared.as_slice() {
        several if arguments.json => as_json(alignment, several),
        [one] => as_text(alignment, one),
        several => as_table(alignment, several),
    })?;
    compared
        .iter()
        .try_for_each(|one| check_ate(one.absolute.translation_m.rmse, arguments.max_ate))
}

/// A trajectory, its notes told.
fn noted(path: &Path) -> Result<Trajectory, Failure> {
    let trajectory = read_trajectory(path)?;
    for note in &trajectory.notes {
        remark(&format!("{}: {note}", path.display()));
    }
    Ok(trajectory)
}

fn compare(
    arguments: &Arguments,
    path: &Path,
    reference: &Trajectory,
) -> Result<Compared, Failure> {
    let estimate = noted(path)?;
    let file = path.display().to_string();
    // With one estimate its name would say nothing that the command line did not.
    let of_file = if arguments.estimates.len() > 1 {
        format!("{file}: ")
    } else {
        String::new()
    };
    let alignment = Alignment::from(arguments.align);
    let matching = Matching {
        max_difference_s: arguments.max_time_difference,
        offset_s: arguments.time_offset,
    };
    let fault = |error: EvaluationError| {
        let hint = match error {
            EvaluationError::NoMatches { .. } => "; see --time-offset and --max-time-difference",
            EvaluationError::Degenerate { .. } if alignment != Alignment::Se2 => {
                "; --align se2 and none ask for less"
            }
            _ => "",
        };
        Failure::input(format!("{of_file}{error}{hint}"))
    };
    let pairs = matching
        .pairs(&estimate.poses, &reference.poses)
        .map_err(fault)?;
    let most = estimate.poses.len().min(reference.poses.len());
    if 2 * pairs.len() < most {
        remark(&format!(
            "{of_file}only {} of {most} poses have one within {} s in the other trajectory: see --max-time-difference and \
             --time-offset",
            pairs.len(),
            arguments.max_time_difference
        ));
    }
    let absolute = absolute_error_of(&pairs, alignment).map_err(fault)?;
    let rotations = estimate.rotations && reference.rotations;
    let relative = if rotations {
        match relative_error_of(&pairs, arguments.delta, alignment) {
            Ok(relative) => Some(relative),
            Err(error) => {
                remark(&format!("{of_file}no relative error: {error}"));
                None
            }
        }
    } else {
        None
    };
    Ok(Compared {
        file,
        poses: [estimate.poses.len(), reference.poses.len()],
        rotations,
        absolute,
        relative,
    })
}
