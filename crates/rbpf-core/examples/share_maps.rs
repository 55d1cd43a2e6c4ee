//! What it costs to copy the maps of 100 particles in a resampling and then to update ten landmarks in each,
//! shared maps against plain vectors. Prints a table in CSV.
//!
//! `cargo run --release --example share_maps`

use nalgebra::{Matrix2, Vector2};
use rbpf_core::{CowMap, Gaussian, Landmark};
use std::hint::black_box;
use std::time::Instant;

const PARTICLES: usize = 100;
const UPDATED: u32 = 10;
const REPEATS: u32 = 5;

/// Microseconds, the fastest of some runs.
fn fastest<T>(mut work: impl FnMut() -> T) -> f64 {
    (0..REPEATS)
        .map(|_| {
            let start = Instant::now();
            let made = black_box(work());
            let taken = start.elapsed().as_secs_f64() * 1e6;
            drop(made);
            taken
        })
        .fold(f64::INFINITY, f64::min)
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() {
    let landmark = Landmark {
        position: Gaussian {
            mean: Vector2::zeros(),
            covariance: Matrix2::<f64>::identity(),
        },
        existence: 0.0,
    };
    println!(
        "landmarks,shared_copy_us,plain_copy_us,shared_copy_update_us,plain_copy_update_us,own_leaves_percent"
    );
    for landmarks in [1_000_u32, 10_000, 100_000] {
        let map: CowMap<Landmark<2>> = (0..landmarks).map(|id| (id, landmark)).collect();
        let plain = vec![landmark; landmarks as usize];
        let shared_copy = fastest(|| vec![black_box(&map).clone(); PARTICLES]);
        let plain_copy = fastest(|| vec![black_box(&plain).clone(); PARTICLES]);
        let update_shared = || {
            let mut maps = vec![black_box(&map).clone(); PARTICLES];
            for map in &mut maps {
                for k in 0..UPDATED {
                    if let Some(landmark) = map.get_mut(k * (landmarks / UPDATED)) {
                        landmark.existence += 1.0;
                    }
                }
            }
            maps
        };
        let shared_update = fastest(update_shared);
        let plain_update = fastest(|| {
            let mut maps = vec![black_box(&plain).clone(); PARTICLES];
            for map in &mut maps {
                for k in 0..UPDATED {
                    map[(k * (landmarks / UPDATED)) as usize].existence += 1.0;
                }
            }
            maps
        });
        let count = update_shared()[0].shared_leaves_with(&map);
        let own = 100.0 * (1.0 - count.shared as f64 / count.total as f64);
        println!(
            "{landmarks},{shared_copy:.1},{plain_copy:.1},{shared_update:.1},{plain_update:.1},{own:.2}"
        );
    }
}
