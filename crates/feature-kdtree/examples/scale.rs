//! Time, recall and memory of every index on descriptors read from files, as comma-separated values.
//!
//! `cargo run --release --example scale -- DIR [SIZE...]` reads `DIR/base_SIZE.u8`, `DIR/query_SIZE.u8` and
//! `DIR/insert.u8`, rows of 128 bytes, by default for 1500, 10000, 100000 and 1000000. Queries go in one batch on this
//! thread. Columns: median time of all queries scaled to 300; share of exact nearest distances found; share of the exact
//! matches of the ratio test at 0.8 that are found, and matches found beyond them as a share of the same; time to insert
//! all; mean and worst time of inserting 100 more (`insert.u8` in portions of 100); heap bytes an entry before these.

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use feature_kdtree::{
    AutoIndex, Descriptor, DescriptorIndex, ExactScan, InvertedLists, InvertedListsParams,
    KdForest, KdForestParams, TwoNearest,
};

const SIZES: [usize; 4] = [1500, 10_000, 100_000, 1_000_000];
const RATIO: f64 = 0.8;
/// Insertions timed together.
const PORTION: usize = 100;
/// Each method answers the batch this often, or until it has taken as long.
const ROUNDS: usize = 51;
const LONGEST: Duration = Duration::from_secs(5);

type Maker = Box<dyn Fn() -> Result<Box<dyn DescriptorIndex>, Box<dyn Error>>>;

fn methods() -> Vec<(String, Maker)> {
    let mut methods: Vec<(String, Maker)> = vec![
        (
            "exact scan".into(),
            Box::new(|| Ok(Box::new(ExactScan::new()))),
        ),
        ("auto".into(), Box::new(|| Ok(Box::new(AutoIndex::new())))),
    ];
    for probes in [None, Some(64)] {
        let name = probes.map_or(String::new(), |probes| format!(" probes {probes}"));
        let make: Maker = Box::new(move || {
            let params = InvertedListsParams {
                probes,
                ..InvertedListsParams::default()
            };
            Ok(Box::new(InvertedLists::new(params)?))
        });
        methods.push((format!("inverted lists{name}"), make));
    }
    let default_leaves = KdForestParams::default().max_leaves;
    for max_leaves in [default_leaves, 4 * default_leaves] {
        let make: Maker = Box::new(move || {
            let params = KdForestParams {
                max_leaves,
                ..KdForestParams::default()
            };
            Ok(Box::new(KdForest::new(params)?))
        });
        methods.push((format!("kd-forest leaves {max_leaves}"), make));
    }
    methods
}

#[expect(clippy::print_stdout, reason = "the table is what this program makes")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("usage: scale DIR [SIZE...]")?;
    let mut sizes = arguments
        .map(|size| size.parse())
        .collect::<Result<Vec<usize>, _>>()?;
    if sizes.is_empty() {
        sizes = SIZES.to_vec();
    }
    let more = read(&Path::new(&folder).join("insert.u8"))?;
    println!(
        "method,size,ms_per_300_queries,recall1,ratio_matches_kept,ratio_matches_added,build_ms,insert100_ms_mean,insert100_ms_worst,bytes_per_descriptor"
    );
    for size in sizes {
        let base = read(&Path::new(&folder).join(format!("base_{size}.u8")))?;
        let queries = read(&Path::new(&folder).join(format!("query_{size}.u8")))?;
        let mut truth = Vec::new();
        let mut scan = ExactScan::new();
        insert_all(&mut scan, 0, &base)?;
        scan.two_nearest_batch(&queries, &mut truth);
        drop(scan);
        for (name, make) in methods() {
            let mut index = make()?;
            let build = insert_all(index.as_mut(), 0, &base)?;
            let bytes = index.memory_usage() as f64 / base.len() as f64;
            let (time, found) = answer(index.as_ref(), &queries);
            let [recall, kept, added] = quality(&found, &truth);
            let last = insert_all(index.as_mut(), base.len() as u32, &more)?;
            let mean = last.iter().sum::<Duration>() / last.len().max(1) as u32;
            let worst = last.iter().max().copied().unwrap_or_default();
            let ms = |time: Duration| 1e3 * time.as_secs_f64();
            println!(
                "{name},{size},{:.4},{recall:.4},{kept:.4},{added:.4},{:.1},{:.4},{:.4},{bytes:.1}",
                ms(time) * 300.0 / queries.len() as f64,
                ms(build.iter().sum()),
                ms(mean),
                ms(worst),
            );
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<Descriptor>, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let (rows, rest) = bytes.as_chunks();
    if !rest.is_empty() || rows.is_empty() {
        return Err(format!("{}: not rows of 128 bytes", path.display()).into());
    }
    Ok(rows.to_vec())
}

/// Inserts under ids counted up from `id`; the times of the portions.
fn insert_all(
    index: &mut dyn DescriptorIndex,
    mut id: u32,
    base: &[Descriptor],
) -> Result<Vec<Duration>, Box<dyn Error>> {
    let mut times = Vec::new();
    for portion in base.chunks(PORTION) {
        let start = Instant::now();
        for descriptor in portion {
            index.insert(id, descriptor)?;
            id += 1;
        }
        times.push(start.elapsed());
    }
    Ok(times)
}

/// Median time of the batch and its answers.
fn answer(
    index: &dyn DescriptorIndex,
    queries: &[Descriptor],
) -> (Duration, Vec<Option<TwoNearest>>) {
    let mut found = Vec::new();
    let mut times = Vec::new();
    let begin = Instant::now();
    while times.len() < ROUNDS && (times.len() < 3 || begin.elapsed() < LONGEST) {
        let start = Instant::now();
        index.two_nearest_batch(queries, &mut found);
        times.push(start.elapsed());
    }
    times.sort_unstable();
    (times[times.len() / 2], found)
}

/// Shares of nearest distances found, of exact matches kept, and of matches beyond them.
fn quality(found: &[Option<TwoNearest>], truth: &[Option<TwoNearest>]) -> [f64; 3] {
    let matched = |nearest: &TwoNearest| {
        nearest.second.is_some_and(|second| {
            f64::from(nearest.first.distance_squared)
                < RATIO * RATIO * f64::from(second.distance_squared)
        })
    };
    let (mut nearest, mut matches, mut kept, mut added) = (0, 0, 0, 0);
    for (found, truth) in found.iter().flatten().zip(truth.iter().flatten()) {
        nearest += usize::from(found.first.distance_squared == truth.first.distance_squared);
        let same = matched(truth) && found.first.id == truth.first.id;
        matches += usize::from(matched(truth));
        kept += usize::from(matched(found) && same);
        added += usize::from(matched(found) && !same);
    }
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    [
        share(nearest, truth.len()),
        share(kept, matches),
        share(added, matches),
    ]
}
