//! Two images of one place, of two places, and of a wall.

use nalgebra::{Matrix3, Vector2};
use place_recognition::{SamePlaceOptions, View, same_place};
use rand::RngExt;

use crate::world::World;

struct Image {
    pixels: Vec<Vector2<f64>>,
    descriptors: Vec<[u8; 128]>,
}

impl Image {
    fn view(&self) -> View<'_> {
        View {
            pixels: &self.pixels,
            descriptors: &self.descriptors,
            width: 640,
            height: 480,
        }
    }
}

/// Two images: `right` points that both see, on a wall if asked for, and `wrong` equal descriptors at pixels of no relation.
fn images(seed: u64, right: u32, wrong: u32, planar: bool) -> (Image, Image) {
    let mut world = World::new(seed, 1);
    let (first, second) = (world.camera(0), world.camera(0));
    let empty = || Image {
        pixels: Vec::new(),
        descriptors: Vec::new(),
    };
    let (mut a, mut b) = (empty(), empty());
    for number in 0..right + wrong {
        let point = world.point_in_view(&first, planar);
        let exact = Matrix3::zeros();
        let in_first = world
            .true_match(number, &first, point, 0, &exact)
            .pixel_ideal;
        let in_second = world
            .true_match(number, &second, point, 0, &exact)
            .pixel_ideal;
        let descriptor: [u8; 128] = std::array::from_fn(|_| world.rng.random_range(0..90));
        a.pixels.push(in_first);
        a.descriptors.push(descriptor);
        b.pixels.push(if number < right {
            in_second
        } else {
            world.pixel()
        });
        b.descriptors
            .push(descriptor.map(|v| v + world.rng.random_range(0..6)));
    }
    (a, b)
}

#[test]
fn one_place_from_two_points_is_recognised_and_two_places_are_not() {
    for seed in 0..10 {
        let options = SamePlaceOptions {
            seed,
            ..SamePlaceOptions::default()
        };
        for planar in [false, true] {
            let (a, b) = images(seed, 60, 40, planar);
            let evidence = same_place(&a.view(), &b.view(), &options).unwrap();
            assert!(evidence.same_place, "{seed} {planar}: {evidence:?}");
            assert!(evidence.matches > 95);
            let right = evidence.inliers.iter().filter(|(i, _)| *i < 60).count();
            assert!(right >= 45, "{seed} {planar}: {right} of 60");
        }
        let (a, b) = images(seed, 0, 100, false);
        let evidence = same_place(&a.view(), &b.view(), &options).unwrap();
        assert!(!evidence.same_place, "{seed}: {evidence:?}");
        assert!(evidence.matches > 95);
    }
}

#[test]
fn keypoints_of_several_orientations_count_once() {
    let (a, b) = images(1, 30, 0, false);
    let twice = |image: &Image, shift: u8| {
        let turned = image.descriptors.iter().map(|d| {
            let mut turned = d.map(|v| 95 - v.min(95));
            turned[0] = shift;
            turned
        });
        Image {
            pixels: [image.pixels.clone(), image.pixels.clone()].concat(),
            descriptors: image.descriptors.iter().copied().chain(turned).collect(),
        }
    };
    let (a, b) = (twice(&a, 1), twice(&b, 2));
    let evidence = same_place(&a.view(), &b.view(), &SamePlaceOptions::default()).unwrap();
    assert_eq!(evidence.matches, 30);
}
