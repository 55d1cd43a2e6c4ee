//! Cost of a resampling of 100 particles with shared maps and with plain vectors, without and with
//! ten landmarks updated in each copy.
//!
//! Prints CSV: microseconds (the median of all repeats, without releasing the copies) and the bytes that
//! the 100 new maps hold beside the old one. The ten landmarks lie in ten leaves, whatever the size of
//! the map.
//!
//! `cargo run --release -p rbpf-core --example share_maps > maps.csv`

use rbpf_core::CowMap;
use std::hint::black_box;
use std::time::Instant;

const PARTICLES: usize = 100;
const UPDATED: u32 = 10;
/// Rounds in which both kinds of map take their turn, so that a busy machine is busy for both.
const ROUNDS: usize = 5;
const REPEATS: usize = 15;

/// A landmark in the plane, 56 bytes.
#[derive(Clone, Copy, Default)]
struct Landmark {
    _mean: [f64; 2],
    _covariance: [f64; 4],
    existence: f64,
}

type Shared = CowMap<Landmark>;
type Plain = Vec<Landmark>;

/// Ids of the updated landmarks: no two in a leaf of 16, all below 1000.
fn updated() -> impl Iterator<Item = u32> {
    (0..UPDATED).map(|k| 97 * k)
}

fn copy_shared(map: &Shared, update: bool) -> Vec<Shared> {
    let mut copies: Vec<Shared> = (0..PARTICLES).map(|_| map.clone()).collect();
    if update {
        for copy in &mut copies {
            for id in updated() {
                if let Some(landmark) = copy.get_mut(id) {
                    landmark.existence += 1.0;
                }
            }
        }
    }
    copies
}

fn copy_plain(map: &Plain, update: bool) -> Vec<Plain> {
    let mut copies: Vec<Plain> = (0..PARTICLES).map(|_| map.clone()).collect();
    if update {
        for copy in &mut copies {
            for id in updated() {
                copy[id as usize].existence += 1.0;
            }
        }
    }
    copies
}

/// Microseconds of some copies, one value each. Earlier copies live until the next are made, as the
/// particles of a filter do, and the allocator is warm.
fn time<T>(copy: impl Fn() -> T) -> Vec<f64> {
    let mut before = [copy(), copy(), copy()];
    let mut times = Vec::with_capacity(REPEATS);
    for k in 0..REPEATS {
        let start = Instant::now();
        let made = black_box(copy());
        times.push(start.elapsed().as_secs_f64() * 1e6);
        before[k % 3] = made;
    }
    times
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() {
    let landmark = Landmark::default();
    println!("landmarks,updates,shared_us,plain_us,shared_bytes,plain_bytes");
    for landmarks in [1_000_u32, 10_000, 100_000] {
        let shared: Shared = (0..landmarks).map(|id| (id, landmark)).collect();
        let plain: Plain = vec![landmark; landmarks as usize];
        for update in [false, true] {
            let (mut of_shared, mut of_plain) = (vec![], vec![]);
            for _ in 0..ROUNDS {
                of_shared.extend(time(|| copy_shared(black_box(&shared), update)));
                of_plain.extend(time(|| copy_plain(black_box(&plain), update)));
            }
            let (of_shared, of_plain) = (median(of_shared), median(of_plain));
            let own: usize = copy_shared(&shared, update)
                .iter()
                .map(|copy| size_of::<Shared>() + copy.shared_leaves_with(&shared).own_bytes)
                .sum();
            let whole = PARTICLES * (size_of::<Plain>() + size_of_val(plain.as_slice()));
            let updates = if update { UPDATED } else { 0 };
            println!("{landmarks},{updates},{of_shared:.2},{of_plain:.1},{own},{whole}");
        }
    }
}
