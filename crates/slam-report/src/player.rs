//! Frame by frame: the data that the script of the page steps through, within the room that the page leaves.
//!
//! Positions and ellipses are in tenths of a unit of the drawing of the view from above, angles in degrees, keypoints as
//! [`keypoint_marks`](crate::keypoint_marks) packs them. The JPEG files of one quality begin alike: what stands before
//! their pixels is kept once. Where the room is short, every n-th picture and every n-th row is left out; the rows where
//! the state of the run changes stay longest.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use slam_io::{FrameRecord, FrameSnapshot, RunRecord};
use slam_pipeline::{KeypointFate, Tracking};

use crate::keypoint_marks::{COLUMNS, FATES, RADII, encoded, marks, rows};
use crate::pictures::keys;
use crate::plot::{Ellipse, Placement};

/// Rows at most: more of them no slider can tell apart.
const MOST_ROWS: usize = 1200;
/// Thinner than this nothing is worth showing.
const THINNEST: usize = 1 << 12;
const SCRIPT: &str = include_str!("player.js");
const HTML: &str = include_str!("player.html");

/// How the view from above shows poses.
pub(super) struct View {
    /// From metres to the drawing.
    pub(super) placement: Placement,
    /// By how much ellipses of three sigma are enlarged.
    pub(super) magnified: f64,
}

/// The elements that the script fills; hidden without it.
pub(super) fn elements() -> String {
    HTML.replace("KEYS", &keys())
}

/// Data and script in at most `room` bytes; empty where not even that of few frames fits.
pub(super) fn script(run: &RunRecord, view: &View, room: usize) -> String {
    let room = room.saturating_sub(SCRIPT.len() + 100);
    let packed: Vec<Packed> = run.snapshots.iter().map(Packed::of).collect();
    let mut every = 1;
    while every <= THINNEST {
        let data = data(run, view, &packed, every);
        if data.len() <= room {
            return format!(
                "<script type=\"application/json\" id=\"run-data\">{data}</script>\n<script>\n{SCRIPT}</script>\n"
            );
        }
        // Steps of a quarter, so that no more is left out than need be.
        every += (every / 4).max(1);
    }
    String::new()
}

/// A snapshot as the page keeps it.
struct Packed {
    frame: usize,
    lines: usize,
    header: Vec<u8>,
    body: String,
    keypoints: String,
}

impl Packed {
    fn of(snapshot: &FrameSnapshot) -> Self {
        let (header, body) = snapshot.jpeg.split_at(header_length(&snapshot.jpeg));
        Packed {
            frame: snapshot.index,
            lines: rows(snapshot),
            header: header.to_vec(),
            body: STANDARD.encode(body),
            keypoints: STANDARD.encode(encoded(&marks(snapshot))),
        }
    }
}

/// Bytes of a JPEG file before its pixels; nought where it is none.
fn header_length(jpeg: &[u8]) -> usize {
    let mut at = 2;
    while let Some(&[0xff, kind, high, low]) = jpeg.get(at..at + 4) {
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        if kind == 0xda {
            return at.min(jpeg.len());
        }
    }
    0
}

/// The frames that have a row.
fn chosen<'a>(run: &'a RunRecord, packed: &[&Packed], every: usize) -> Vec<&'a FrameRecord> {
    let frames = &run.frames;
    let stride = frames.len().div_ceil(MOST_ROWS).max(1) * every;
    let changes = |k: usize| {
        let report = &frames[k].report;
        let state = |k: usize| frames.get(k).map(|f| f.report.tracking);
        report.revisit
            || report.tracking == Tracking::Relocalised
            || state(k) != state(k + 1)
            || k > 0 && state(k) != state(k - 1)
    };
    let all_changes = (0..frames.len()).filter(|&k| changes(k)).count() <= MOST_ROWS / every;
    frames
        .iter()
        .enumerate()
        .filter(|(k, frame)| {
            k % stride == 0
                || all_changes && changes(*k)
                || packed
                    .binary_search_by_key(&frame.index, |p| p.frame)
                    .is_ok()
        })
        .map(|(_, frame)| frame)
        .collect()
}

fn data(run: &RunRecord, view: &View, packed: &[Packed], every: usize) -> String {
    let packed: Vec<&Packed> = packed.iter().step_by(every).collect();
    let chosen = chosen(run, &packed, every.div_ceil(4));
    let mut headers: Vec<&[u8]> = Vec::new();
    let mut pictures = Vec::new();
    for picture in &packed {
        let Some(row) = chosen.iter().position(|frame| frame.index == picture.frame) else {
            continue;
        };
        let header = headers
            .iter()
            .position(|header| *header == picture.header)
            .unwrap_or_else(|| {
                headers.push(&picture.header);
                headers.len() - 1
            });
        pictures.push(json!([
            row,
            picture.lines,
            header,
            picture.body,
            picture.keypoints
        ]));
    }
    let (notes, noted) = notes(&chosen);
    let fates: Vec<Value> = FATES
        .iter()
        .map(|(fate, _, colour)| {
            let tails = matches!(fate, KeypointFate::Matched | KeypointFate::Outlier);
            json!({ "colour": colour, "tails": tails })
        })
        .collect();
    let headers: Vec<String> = headers
        .iter()
        .map(|header| STANDARD.encode(header))
        .collect();
    let data = json!({
        "total": run.frames.len(),
        "columns": COLUMNS,
        "radii": RADII.map(|radius| (f64::from(radius) * 10.0).round() / 10.0),
        "fates": fates,
        "headers": headers,
        "pictures": pictures,
        "frames": columns(&chosen, view),
        "notes": notes,
        "noted": noted,
    });
    // Nothing inside the data may end the element that holds it.
    data.to_string().replace('<', "\\u003c")
}

/// One list a quantity, one entry a row.
fn columns(chosen: &[&FrameRecord], view: &View) -> Value {
    let tenths = |value: f64| (10.0 * value.clamp(-1e5, 1e5)).round() as i64;
    let degrees = |value: f64| value.to_degrees().round() as i64;
    let of = |pick: &dyn Fn(&FrameRecord) -> i64| -> Vec<i64> {
        chosen.iter().map(|frame| pick(frame)).collect()
    };
    let flags = |pick: &dyn Fn(&FrameRecord) -> bool| -> String {
        chosen
            .iter()
            .map(|f| if pick(f) { '1' } else { '0' })
            .collect()
    };
    let pose = |frame: &FrameRecord| frame.report.estimate.pose;
    let at = |frame: &FrameRecord| view.placement.at((pose(frame).x, pose(frame).y));
    let ellipse = |frame: &FrameRecord| {
        let c = &frame.report.estimate.covariance;
        let sigmas = 3.0 * view.magnified * view.placement.per_unit();
        Ellipse::of_covariance((0.0, 0.0), c[(0, 0)], c[(0, 1)], c[(1, 1)], sigmas)
    };
    let t: Vec<f64> = chosen
        .iter()
        .map(|frame| (1e3 * frame.time_s).round() / 1e3)
        .map(|t| if t.is_finite() { t } else { 0.0 })
        .collect();
    let state: String = chosen
        .iter()
        .map(|frame| match frame.report.tracking {
            Tracking::Tracking => 't',
            Tracking::Lost => 'l',
            Tracking::Relocalised => 'r',
        })
        .collect();
    json!({
        "index": of(&|f| f.index as i64),
        "t": t,
        "x": of(&|f| tenths(at(f).0)),
        "y": of(&|f| tenths(at(f).1)),
        "heading": of(&|f| degrees(pose(f).phi)),
        "major": of(&|f| tenths(ellipse(f).half_axes.0)),
        "minor": of(&|f| tenths(ellipse(f).half_axes.1)),
        "angle": of(&|f| degrees(ellipse(f).angle)),
        "keypoints": of(&|f| f.keypoints as i64),
        "matches": of(&|f| f.report.matches as i64),
        "outliers": of(&|f| f.report.outliers as i64),
        "fresh": of(&|f| f.report.new_landmarks as i64),
        "landmarks": of(&|f| f.report.landmarks as i64),
        "state": state,
        "key": flags(&|f| f.report.keyframe),
        "revisit": flags(&|f| f.report.revisit),
        "doubted": flags(&|f| f.report.odometry_doubted),
    })
}

/// The notes, each once, and which of them a frame has.
fn notes<'a>(chosen: &[&'a FrameRecord]) -> (Vec<&'a str>, BTreeMap<usize, Vec<usize>>) {
    let mut notes: Vec<&str> = Vec::new();
    let mut noted: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for frame in chosen {
        for note in &frame.report.notes {
            let place = notes.iter().position(|n| n == note).unwrap_or_else(|| {
                notes.push(note);
                notes.len() - 1
            });
            noted.entry(frame.index).or_default().push(place);
        }
    }
    (notes, noted)
}
