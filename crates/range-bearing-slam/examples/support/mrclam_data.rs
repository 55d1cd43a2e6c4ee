//! One robot of the UTIAS MRCLAM data (Leung, Halpern, Barfoot, Liu, IJRR 30(8), 2011) as frames.

use super::tables::read_table;
use estimation_base::wrap;
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// Subjects up to this number are robots, those above landmarks.
const ROBOTS: u32 = 5;
/// Longest time between two frames, with measurements or without, seconds.
const LONGEST_FRAME: f64 = 1.0;

/// The data of one time.
#[derive(Clone, Debug)]
pub(crate) struct Instant {
    /// Commands since the last instant: seconds, forward velocity in m/s, turn rate in rad/s.
    pub(crate) odometry: Vec<[f64; 3]>,
    /// Landmark subjects with range in metres and bearing in radians.
    pub(crate) measurements: Vec<(u32, Vector2<f64>)>,
    /// The pose by the motion capture.
    pub(crate) truth: Vector3<f64>,
}

/// One robot's run.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// The instants in the order of time.
    pub(crate) instants: Vec<Instant>,
    /// The pose at the first odometry, by the motion capture.
    pub(crate) start: Vector3<f64>,
    /// Surveyed positions by subject.
    pub(crate) landmarks: BTreeMap<u32, Vector2<f64>>,
}

/// Reads robot `number` (1 to 5) of the data in `folder`, up to `seconds` after the first odometry.
///
/// Measurements of other robots, and barcodes that nothing carries, are left out.
///
/// # Errors
/// The name of a file that is missing, or of one with a broken line.
pub(crate) fn load(folder: &Path, number: u32, seconds: f64) -> Result<Run, Box<dyn Error>> {
    let file = |what: &str| folder.join(format!("Robot{number}_{what}.dat"));
    let subjects: BTreeMap<u32, u32> = read_table::<2>(&folder.join("Barcodes.dat"))?
        .iter()
        .map(|&[subject, barcode]| (barcode as u32, subject as u32))
        .collect();
    let landmarks = read_table::<3>(&folder.join("Landmark_Groundtruth.dat"))?
        .iter()
        .map(|&[subject, x, y]| (subject as u32, Vector2::new(x, y)))
        .collect();
    let odometry = read_table::<3>(&file("Odometry"))?;
    let measurements = read_table::<4>(&file("Measurement"))?;
    let truth = read_table::<4>(&file("Groundtruth"))?;

    let begin = odometry[0][0].max(truth[0][0]);
    let end = truth[truth.len() - 1][0].min(begin + seconds);
    let mut seen: BTreeMap<u64, Vec<(u32, Vector2<f64>)>> = BTreeMap::new();
    for [time, barcode, range, bearing] in measurements {
        let subject = subjects.get(&(barcode as u32)).copied().unwrap_or(0);
        if time > begin && time <= end && subject > ROBOTS {
            let same_time = seen.entry(milliseconds(time - begin)).or_default();
            if same_time.iter().all(|&(other, _)| other != subject) {
                same_time.push((subject, Vector2::new(range, bearing)));
            }
        }
    }

    let mut run = Run {
        instants: Vec::new(),
        start: pose_at(&truth, begin),
        landmarks,
    };
    let mut pending = Vec::new();
    let mut last = 0.0;
    for (index, &[time, velocity, turn_rate]) in odometry.iter().enumerate() {
        let mut from = (time - begin).max(0.0);
        let until = odometry.get(index + 1).map_or(end, |next| next[0]).min(end) - begin;
        while from < until {
            // up to the end of this command, the next measurement or the longest frame
            let next_seen = seen
                .first_key_value()
                .map_or(f64::INFINITY, |(&at, _)| at as f64 / 1000.0);
            let stop = until.min(next_seen.max(from)).min(last + LONGEST_FRAME);
            push_command(&mut pending, [stop - from, velocity, turn_rate]);
            from = stop;
            if stop >= next_seen || stop >= last + LONGEST_FRAME {
                let measurements = if stop >= next_seen {
                    seen.pop_first()
                        .map(|(_, at_once)| at_once)
                        .unwrap_or_default()
                } else {
                    Vec::new()
                };
                last = stop;
                run.instants.push(Instant {
                    odometry: std::mem::take(&mut pending),
                    measurements,
                    truth: pose_at(&truth, stop + begin),
                });
            }
        }
    }
    Ok(run)
}

/// Appends a command, or lengthens the last one if it stays the same.
fn push_command(commands: &mut Vec<[f64; 3]>, next: [f64; 3]) {
    match commands.last_mut() {
        Some(last) if last[1] == next[1] && last[2] == next[2] => last[0] += next[0],
        _ => commands.push(next),
    }
}

/// The pose at a time, linear between two entries of the motion capture.
fn pose_at(truth: &[[f64; 4]], time: f64) -> Vector3<f64> {
    let after = truth
        .partition_point(|row| row[0] < time)
        .clamp(1, truth.len() - 1);
    let ([t0, x0, y0, phi0], [t1, x1, y1, phi1]) = (truth[after - 1], truth[after]);
    let share = ((time - t0) / (t1 - t0)).clamp(0.0, 1.0);
    Vector3::new(
        x0 + share * (x1 - x0),
        y0 + share * (y1 - y0),
        wrap(phi0 + share * wrap(phi1 - phi0)),
    )
}

fn milliseconds(seconds: f64) -> u64 {
    (seconds * 1000.0).round() as u64
}
