//! The Victoria Park run (Guivant and Nebot, IEEE Trans. Robotics and Automation 17(3), 2001) as
//! frames: wheel speed and steering, ranges and bearings of tree trunks, satellite fixes.

use super::tables::read_table;
use nalgebra::Vector2;
use std::error::Error;
use std::path::Path;

/// Largest range of a trunk, metres; the authors of the data leave farther ones out too.
const FARTHEST: f64 = 30.0;

/// One scan, and the odometry before it.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    /// Seconds since the first odometry.
    pub(crate) time: f64,
    /// Odometry since the last scan: seconds, speed of the rear left wheel in m/s, steering in radians.
    pub(crate) odometry: Vec<[f64; 3]>,
    /// Range and bearing of trunks, without names.
    pub(crate) trunks: Vec<Vector2<f64>>,
}

/// The scans and satellite fixes of the run.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// The scans in the order of time.
    pub(crate) scans: Vec<Scan>,
    /// Satellite fixes: seconds since the first odometry, and the position in a frame of its own.
    pub(crate) fixes: Vec<(f64, Vector2<f64>)>,
}

/// Reads the data in `folder`, up to `seconds` after the first odometry.
///
/// # Errors
/// The name of a file that is missing, or of one with a broken line.
pub(crate) fn load(folder: &Path, seconds: f64) -> Result<Run, Box<dyn Error>> {
    let odometry = read_table::<3>(&folder.join("odometry.csv"))?;
    let observations = read_table::<3>(&folder.join("observations.csv"))?;
    let begin = odometry[0][0];
    let since = |milliseconds: f64| (milliseconds - begin) / 1000.0;
    let fixes = read_table::<3>(&folder.join("gps.csv"))?
        .iter()
        .map(|&[time, x, y]| (since(time), Vector2::new(x, y)))
        .filter(|(time, _)| (0.0..=seconds).contains(time))
        .collect();

    let mut scans: Vec<Scan> = Vec::new();
    for [time, range, bearing] in observations {
        let time = since(time);
        if !(0.0..=seconds).contains(&time) {
            continue;
        }
        if scans.last().is_none_or(|last| last.time < time) {
            scans.push(Scan {
                time,
                odometry: Vec::new(),
                trunks: Vec::new(),
            });
        }
        if range < FARTHEST
            && let Some(scan) = scans.last_mut()
        {
            scan.trunks.push(Vector2::new(range, bearing));
        }
    }
    let mut row = 0;
    let mut from = 0.0;
    for scan in &mut scans {
        while from < scan.time {
            let next = odometry
                .get(row + 1)
                .map_or(f64::INFINITY, |next| since(next[0]));
            let stop = next.min(scan.time);
            scan.odometry
                .push([stop - from, odometry[row][1], odometry[row][2]]);
            from = stop;
            if stop >= next {
                row += 1;
            }
        }
    }
    Ok(Run { scans, fixes })
}

/// The positions of a path at the satellite fixes that it spans, and those fixes. The path has one
/// position a scan and is linear between scans.
pub(crate) fn at_fixes(run: &Run, path: &[Vector2<f64>]) -> (Vec<Vector2<f64>>, Vec<Vector2<f64>>) {
    run.fixes
        .iter()
        .filter_map(|&(time, fix)| {
            let after = run.scans.partition_point(|scan| scan.time < time);
            let (before, after) = (after.checked_sub(1)?, run.scans.get(after).map(|_| after)?);
            let share =
                (time - run.scans[before].time) / (run.scans[after].time - run.scans[before].time);
            Some((path[before] + (path[after] - path[before]) * share, fix))
        })
        .unzip()
}
