//! Odometry made from a reference path, for sequences that have no other.
//!
//! Each row holds the motion from one reference pose to the next, with white noise: a row of dt seconds has independent
//! errors of standard deviation sigma_v / sqrt(dt) in its speed and sigma_w / sqrt(dt) in its turn rate, so that distance
//! and heading drift by sigma_v and sigma_w per square root of a second at every rate of the reference. The errors come from
//! ChaCha8 with the seed that the user gave. Such a run shows what the filter makes of the images; it says nothing about a
//! robot's own wheels.

use mono_geometry::Se2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::poses::rows_of_poses;
use super::rows::OdometryRow;

/// Rows from poses at ascending times; the last repeats the one before it. O(poses).
pub(super) fn rows_with_noise(
    reference: &[(f64, Se2)],
    sigma_v: f64,
    sigma_w: f64,
    seed: u64,
) -> Vec<OdometryRow> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = rows_of_poses(reference);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for index in 0..rows.len().saturating_sub(1) {
        let root_s = (rows[index + 1].t_s - rows[index].t_s).sqrt();
        rows[index].v_mps += sigma_v * normal() / root_s;
        rows[index].omega_radps += sigma_w * normal() / root_s;
    }
    if let [.., before, last] = rows.as_mut_slice() {
        (last.v_mps, last.omega_radps) = (before.v_mps, before.omega_radps);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Straight drives of ten seconds as references of 2 and of 50 poses a second.
    #[test]
    fn the_noise_does_not_depend_on_the_rate_of_the_reference() {
        const DRIVES: u64 = 400;
        for rate in [2_u32, 50] {
            let reference: Vec<(f64, Se2)> = (0..=10 * rate)
                .map(|i| f64::from(i) / f64::from(rate))
                .map(|t_s| (t_s, Se2::new(0.5 * t_s, 0.0, 0.0)))
                .collect();
            let (mut way, mut turn) = (0.0, 0.0);
            for seed in 0..DRIVES {
                let rows = rows_with_noise(&reference, 0.03, 0.02, seed);
                assert_eq!(rows.len(), reference.len());
                let sum = |of: fn(&OdometryRow) -> f64| -> f64 {
                    rows.windows(2)
                        .map(|pair| of(&pair[0]) * (pair[1].t_s - pair[0].t_s))
                        .sum()
                };
                way += (sum(|row| row.v_mps) - 5.0).powi(2) / DRIVES as f64;
                turn += sum(|row| row.omega_radps).powi(2) / DRIVES as f64;
            }
            // Variances over ten seconds; 400 drives know them to 7 per cent.
            assert!(
                (way / (0.03_f64.powi(2) * 10.0) - 1.0).abs() < 0.3,
                "{rate}: {way}"
            );
            assert!(
                (turn / (0.02_f64.powi(2) * 10.0) - 1.0).abs() < 0.3,
                "{rate}: {turn}"
            );
        }
        let short = [(0.0, Se2::identity()), (1.0, Se2::new(1.0, 0.0, 0.0))];
        assert_eq!(
            rows_with_noise(&short, 0.1, 0.1, 7),
            rows_with_noise(&short, 0.1, 0.1, 7)
        );
        assert_ne!(
            rows_with_noise(&short, 0.1, 0.1, 7),
            rows_with_noise(&short, 0.1, 0.1, 8)
        );
        assert_eq!(rows_with_noise(&short, 0.0, 0.0, 7)[0].v_mps, 1.0);
    }
}
