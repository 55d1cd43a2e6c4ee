//! Where the state of the run changes: stretches on which it was lost, frames that found it again, revisits.

use slam_io::{FrameRecord, RunRecord};
use slam_pipeline::Tracking;

use crate::plot::{Colour, Layer};

/// Indices of the first and last frame of every stretch on which the run was lost.
pub(super) fn lost_stretches(run: &RunRecord) -> Vec<(usize, usize)> {
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    for (place, frame) in run.frames.iter().enumerate() {
        if frame.report.tracking != Tracking::Lost {
            continue;
        }
        match stretches.last_mut() {
            Some((_, last)) if *last + 1 == place => *last = place,
            _ => stretches.push((place, place)),
        }
    }
    stretches
}

fn frames(run: &RunRecord, found: bool) -> impl Iterator<Item = &FrameRecord> {
    run.frames.iter().filter(move |frame| {
        if found {
            frame.report.tracking == Tracking::Relocalised
        } else {
            frame.report.revisit
        }
    })
}

/// (found again or revisit, name, colour).
const MOMENTS: [(bool, &str, Colour); 2] = [
    (true, "found again", Colour::Teal),
    (false, "revisit", Colour::Purple),
];

/// The same over time, to lie below the curves of a chart.
pub(super) fn over_time(run: &RunRecord) -> Vec<Layer> {
    let mut layers = Vec::new();
    let lost: Vec<(f64, f64)> = lost_stretches(run)
        .into_iter()
        .map(|(first, last)| {
            let end = run.frames.get(last + 1).unwrap_or(&run.frames[last]);
            (run.frames[first].time_s, end.time_s)
        })
        .collect();
    if !lost.is_empty() {
        layers.push(Layer::Spans {
            label: "lost".into(),
            colour: Colour::Red,
            spans: lost,
        });
    }
    for (found, name, colour) in MOMENTS {
        let spans: Vec<_> = frames(run, found).map(|f| (f.time_s, f.time_s)).collect();
        if !spans.is_empty() {
            layers.push(Layer::Spans {
                label: name.into(),
                colour,
                spans,
            });
        }
    }
    layers
}

/// The same on the view from above, to lie on the path.
pub(super) fn on_the_path(run: &RunRecord) -> Vec<Layer> {
    let at = |frame: &FrameRecord| {
        let pose = frame.report.estimate.pose;
        (pose.x, pose.y)
    };
    let mut layers = Vec::new();
    let mut lost = Vec::new();
    for (first, last) in lost_stretches(run) {
        lost.extend(run.frames[first..=last].iter().map(at));
        // From here the line goes on at the next stretch.
        lost.push((f64::NAN, f64::NAN));
    }
    if !lost.is_empty() {
        layers.push(Layer::Line {
            label: "lost".into(),
            colour: Colour::Red,
            width: 4.0,
            dashed: false,
            points: lost,
        });
    }
    for (found, name, colour) in MOMENTS {
        let points: Vec<_> = frames(run, found).map(at).collect();
        if !points.is_empty() {
            layers.push(Layer::Dots {
                label: name.into(),
                colour,
                radius: 4.5,
                points,
            });
        }
    }
    layers
}
