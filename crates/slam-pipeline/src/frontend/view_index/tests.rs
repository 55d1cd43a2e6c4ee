//! The landmarks in view of an index against those of a look at every landmark.

use estimation_base::Manifold;
use nalgebra::{Matrix3, SVector, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::filter::landmark::{Landmark, Parametrisation};
use crate::filter::linearised::{PoseLinearisation, PosePosterior};
use crate::filter::metric::ScaleNote;
use crate::filter::motion::{CarrierModel, MotionPrior};
use crate::filter::observation::Sighting;
use crate::filter::particle::Keyframe;
use crate::filter::pose::CameraPose;
use crate::filter::tests::common::*;
use crate::frontend::catalogue::{Catalogue, CatalogueUpdate, NewFeature};
use crate::frontend::prediction::{InView, Predicted, predict};
use crate::method::DescriptorSearch;

/// Half the edge of the area that the path wanders through, in units.
const AREA: f64 = 25.0;
const SIGMA_PX: f64 = 0.5;

/// A map of keyframes all over an area.
struct World {
    catalogue: Catalogue,
    particle: Particle,
}

fn wander(rng: &mut ChaCha8Rng) -> CameraPose {
    let mut pose = random_pose(rng);
    pose.centre.x = uniform(rng, -AREA, AREA);
    pose.centre.y = uniform(rng, -AREA, AREA);
    pose
}

fn keyframe(pose: CameraPose) -> Keyframe {
    Keyframe {
        pose,
        camera: place(&pose),
        scale: ScaleNote::METRE,
    }
}

/// Parameters of every kind: near, far, at infinity, past it, on the image and beyond its edge.
fn parameters(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let rho = match rng.random_range(0..10) {
        0 => 0.0,
        1 => uniform(rng, -0.05, 0.05),
        2 => uniform(rng, 1.0, 4.0),
        _ => 1.0 / uniform(rng, 0.8, 12.0),
    };
    Vector3::new(uniform(rng, -0.5, 0.5), uniform(rng, -0.4, 0.4), rho)
}

fn landmark(rng: &mut ChaCha8Rng, anchor: u32, points: bool) -> Landmark {
    let sigma = uniform(rng, 1e-4, 0.1);
    let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, sigma * sigma));
    if points {
        let at = Vector3::new(
            uniform(rng, -AREA, AREA),
            uniform(rng, -AREA, AREA),
            uniform(rng, -1.0, 1.0),
        );
        return point(at, covariance);
    }
    Landmark {
        parametrisation: Parametrisation::InverseDepth { anchor },
        mean: parameters(rng),
        covariance,
    }
}

/// Sixty keyframes with eleven landmarks each and three tentative features.
fn world(rng: &mut ChaCha8Rng, points: bool) -> World {
    let mut catalogue = Catalogue::new(DescriptorSearch::InView).unwrap();
    let mut particle = particle(pose(0.0, 0.0, 0.0));
    for number in 0..60 {
        particle.path.push(keyframe(wander(rng)));
        let first = catalogue.next_identities().next().unwrap();
        let new: Vec<NewFeature> = (0..14)
            .map(|_| NewFeature {
                descriptor: core::array::from_fn(|_| rng.random()),
                prototype: landmark(rng, number, false),
                sighting: Sighting {
                    keyframe: number,
                    pixel: Vector2::new(10.0, 20.0),
                },
            })
            .collect();
        catalogue.apply(
            CatalogueUpdate {
                new,
                ..CatalogueUpdate::default()
            },
            None,
        );
        let promoted: Vec<u32> = (first..first + 11).collect();
        for id in &promoted {
            let landmark = landmark(rng, number, points);
            let _ = particle.map.insert(*id, landmark);
        }
        catalogue.apply(
            CatalogueUpdate {
                promoted,
                ..CatalogueUpdate::default()
            },
            None,
        );
    }
    World {
        catalogue,
        particle,
    }
}

/// A prior about a pose in the area; its spread reaches from nothing to a robot that has no idea.
fn prior(rng: &mut ChaCha8Rng) -> MotionPrior {
    let spread = 10.0_f64.powf(uniform(rng, -4.0, 0.0));
    let carrier = CarrierModel {
        tilt_sigma: 0.1 * spread,
        slope_sigma: 0.3 * spread,
        ..planar_carrier()
    };
    let start = particle(wander(rng));
    carrier.prior(
        &Vector2::new(0.1, 0.02),
        &start.departure(),
        &control([0.2, 0.0, 0.1], [spread, spread, 0.4 * spread]),
    )
}

/// Everything that is told of the landmarks in view, to the last bit.
fn told(in_view: &InView<'_>) -> Vec<(u32, Vec<u64>)> {
    let numbers = |p: &Predicted<'_>| -> Vec<u64> {
        let values = p.pixel.iter().chain(&p.covariance).chain(&p.direction);
        values.map(|v| v.to_bits()).collect()
    };
    let landmarks = in_view.landmarks().iter();
    landmarks.map(|(id, p)| (*id, numbers(p))).collect()
}

/// Compares the index with a look at every landmark; returns the numbers in view, looked at, and in all.
fn compare(world: &World, naive: &Catalogue, rng: &mut ChaCha8Rng) -> [usize; 3] {
    let prior = prior(rng);
    let quick = predict(&rig(), &world.catalogue, &world.particle, &prior, SIGMA_PX);
    let all = predict(&rig(), naive, &world.particle, &prior, SIGMA_PX);
    assert_eq!(told(&quick), told(&all));
    let linearisation = PoseLinearisation::new(&rig(), &prior, &PosePosterior::prior());
    let frustum = Frustum::new(&rig(), &linearisation);
    let looked_at = world.catalogue.candidates(&world.particle, &frustum);
    [all.len(), looked_at.len(), world.catalogue.iter().count()]
}

#[test]
fn the_landmarks_in_view_are_those_of_a_look_at_every_landmark() {
    let mut sum = [0; 3];
    for seed in 0..12 {
        let mut rng = rng(900 + seed);
        let points = seed % 3 == 2;
        let mut world = world(&mut rng, points);
        // A catalogue that follows no map looks at every entry.
        let naive = world.catalogue.clone();
        world.catalogue.follow(&world.particle.map);
        for _ in 0..40 {
            for (sum, n) in sum.iter_mut().zip(compare(&world, &naive, &mut rng)) {
                *sum += n;
            }
        }
    }
    let [in_view, looked_at, all] = sum;
    assert!(in_view > 4000, "{in_view}");
    // It is of use, too: the spreads of a robot that has no idea included.
    assert!(looked_at < all / 2, "{looked_at} of {all}");
}

#[test]
fn the_index_follows_updates_removals_corrected_paths_and_other_particles() {
    let mut rng = rng(31);
    let mut world = world(&mut rng, false);
    let naive = world.catalogue.clone();
    world.catalogue.follow(&world.particle.map);
    let mut other = world.particle.clone();
    for round in 0..60 {
        // Updates and removals in both particles, each its own.
        for particle in [&mut world.particle, &mut other] {
            for _ in 0..20 {
                let id = rng.random_range(0..840_u32);
                if let Some(mut known) = particle.map.get(id).copied() {
                    known.mean = parameters(&mut rng);
                    let _ = particle.map.insert(id, known);
                }
            }
            let _ = particle.map.remove(rng.random_range(0..840_u32));
        }
        // Until it has followed, every landmark is looked at.
        let _ = compare(&world, &naive, &mut rng);
        world.catalogue.follow(&world.particle.map);
        let _ = compare(&world, &naive, &mut rng);
        match round % 3 {
            0 => std::mem::swap(&mut world.particle, &mut other),
            1 => {
                // A path driven again: the map is the same memory, the anchors are elsewhere.
                let mut corrected = world.particle.clone();
                corrected.path = rbpf_core::PersistentPath::new();
                for before in world.particle.path.iter() {
                    corrected.path.push(keyframe(near(&mut rng, &before.pose)));
                }
                world.particle = corrected;
                let _ = compare(&world, &naive, &mut rng);
            }
            _ => {}
        }
    }
    // A map with nothing in it.
    world.particle.map = CowMap::new();
    world.catalogue.follow(&world.particle.map);
    let _ = compare(&world, &naive, &mut rng);
}

#[test]
fn every_box_that_holds_a_visible_landmark_may_be_seen() {
    let mut rng = rng(77);
    let mut seen_boxes = 0;
    for _ in 0..3000 {
        let prior = prior(&mut rng);
        let linearisation = PoseLinearisation::new(&rig(), &prior, &PosePosterior::prior());
        let frustum = Frustum::new(&rig(), &linearisation);
        let points = rng.random::<bool>();
        let geometry = if points {
            LandmarkGeometry::Point
        } else {
            let at = prior.mean.retract(&SVector::from_fn(|i, _| {
                [4.0, 4.0, 0.3, 2.0, 0.05, 0.05][i] * uniform(&mut rng, -1.0, 1.0)
            }));
            LandmarkGeometry::InverseDepth { anchor: place(&at) }
        };
        let mut extent = Extent::EMPTY;
        let mut visible = 0;
        for _ in 0..6 {
            let mean = if points {
                ahead(
                    &place(&prior.mean),
                    uniform(&mut rng, -1.0, 1.0),
                    uniform(&mut rng, -1.0, 1.0),
                    uniform(&mut rng, 0.5, 9.0),
                )
            } else {
                parameters(&mut rng)
            };
            extent.include(&mean);
            let landmark = prepared(
                geometry,
                &point(mean, Matrix3::identity() * 1e-6),
                Vector2::zeros(),
                0.25,
                crate::filter::observation::Scoring::Full,
            );
            let in_view = linearisation.linearise(&landmark).is_some_and(|line| {
                (-0.5..=319.5).contains(&line.mean.x) && (-0.5..=239.5).contains(&line.mean.y)
            });
            let seen = frustum.view(&geometry);
            assert!(!in_view || frustum.may_see(&seen, &Extent::of(&mean)));
            visible += usize::from(in_view);
        }
        if visible > 0 {
            seen_boxes += 1;
            assert!(frustum.may_see(&frustum.view(&geometry), &extent));
        }
        assert!(!frustum.may_see(&frustum.view(&geometry), &Extent::EMPTY));
    }
    assert!(seen_boxes > 300, "{seen_boxes}");
}
