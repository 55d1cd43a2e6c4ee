//! Images and files of drives in which something happens.

use wall_scenes::{
    FrameRate, FrameSpan, GreyImage, Kidnap, Mishaps, Scene, SceneSpec, Stop, Stops,
};

fn scene(spec: SceneSpec) -> Scene {
    Scene::new(spec).unwrap()
}

fn mean_and_deviation(image: &GreyImage) -> (f64, f64) {
    let n = image.pixels.len() as f64;
    let mean = image.pixels.iter().map(|&p| f64::from(p)).sum::<f64>() / n;
    let square = image.pixels.iter().map(|&p| (f64::from(p) - mean).powi(2));
    (mean, (square.sum::<f64>() / n).sqrt())
}

/// Mean absolute difference of two images over the pixels that `of` picks.
fn difference(a: &GreyImage, b: &GreyImage, of: impl Fn(usize, usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (index, (x, y)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        if of(index % a.width, index / a.width) {
            sum += (f64::from(*x) - f64::from(*y)).abs();
            count += 1;
        }
    }
    sum / f64::from(count)
}

#[test]
fn dark_and_blocked_frames_hold_noise_only_and_the_others_are_untouched() {
    let spec = SceneSpec {
        frames: 8,
        frame_rate: FrameRate {
            multiple: 2,
            divisor: 1,
        },
        ..SceneSpec::wall(3)
    };
    let mishaps = Mishaps {
        dark: Some(FrameSpan { from: 2, to: 4 }),
        blocked: Some(FrameSpan { from: 5, to: 6 }),
        ..Mishaps::default()
    };
    let (plain, spoiled) = (scene(spec), scene(SceneSpec { mishaps, ..spec }));
    let skins = plain.skins();
    assert_eq!(plain.path(), spoiled.path());
    // Two images a frame.
    for image in 0..plain.images() {
        let seen = spoiled.render(&skins, image);
        let (mean, deviation) = mean_and_deviation(&seen);
        match image {
            4..8 => assert!(mean < 2.0 && deviation < 2.0, "{image}: {mean} {deviation}"),
            10..12 => {
                assert!((35.0..70.0).contains(&mean), "{image}: {mean}");
                assert!((0.5..6.0).contains(&deviation), "{image}: {deviation}");
            }
            _ => assert_eq!(seen, plain.render(&skins, image)),
        }
    }
}

#[test]
fn an_open_shutter_smears_along_the_motion_by_as_much_as_the_scene_moves() {
    let spec = SceneSpec {
        frames: 4,
        noise_px: 0.0,
        ..SceneSpec::wall(3)
    };
    let mishaps = Mishaps {
        shutter_s: 0.2,
        ..Mishaps::default()
    };
    let (sharp, slow) = (scene(spec), scene(SceneSpec { mishaps, ..spec }));
    let skins = sharp.skins();
    let [a, b] = [&sharp, &slow].map(|scene| scene.render(&skins, 2));
    // Differences between neighbours: the smear takes them away across columns, hardly across rows.
    let contrast = |image: &GreyImage, across: usize| {
        let last = image.pixels.len() - across;
        let steps =
            (0..last).map(|k| f64::from(image.pixels[k]) - f64::from(image.pixels[k + across]));
        steps.map(f64::abs).sum::<f64>() / last as f64
    };
    assert!(contrast(&b, 1) < 0.5 * contrast(&a, 1));
    assert!(contrast(&b, 320) > 0.6 * contrast(&a, 320));
    // And it is the mean over the exposure: the smeared image is nearer to the sharp image of its own time than to its
    // neighbours a frame away.
    let near = difference(&a, &b, |_, _| true);
    for other in [1, 3] {
        assert!(near < 0.7 * difference(&sharp.render(&skins, other), &b, |_, _| true));
    }
}

#[test]
fn twin_posters_look_alike_and_nothing_else_changes() {
    let spec = SceneSpec {
        noise_px: 0.0,
        ..SceneSpec::room(3)
    };
    let (plain, twins) = (
        scene(spec),
        scene(SceneSpec {
            twin_posters: true,
            ..spec
        }),
    );
    let skins = twins.skins();
    // The frames in which the middle of each poster is nearest to the middle of the image.
    let (north, south) = ([0.55, 1.9 - 0.52, 0.95], [0.2, 1.9 - 5.0 + 0.52, 0.95]);
    let patch = |middle: [f64; 3], right: f64| -> Vec<f64> {
        let place =
            |x: f64, z: f64| nalgebra::Point3::new(middle[0] + right * x, middle[1], middle[2] + z);
        let frame = (0..twins.images())
            .filter_map(|frame| Some((frame, twins.project(frame, &place(0.0, 0.0))?)))
            .min_by(|a, b| (a.1[0] - 160.0).abs().total_cmp(&(b.1[0] - 160.0).abs()))
            .unwrap()
            .0;
        let image = twins.render(&skins, frame);
        let mut tones = Vec::new();
        for k in 0..400 {
            let point = place(
                -0.3 + 0.03 * f64::from(k % 20),
                -0.3 + 0.03 * f64::from(k / 20),
            );
            let [u, v] = twins.project(frame, &point).unwrap();
            let seen = twins.point_at(frame, u, v).unwrap();
            assert!((seen - point).norm() < 1e-9, "hidden");
            tones.push(f64::from(
                image.pixels[v.round() as usize * 320 + u.round() as usize],
            ));
        }
        tones
    };
    // Seen against +y the viewer's right is +x, seen against -y it is -x.
    let (a, b) = (patch(north, 1.0), patch(south, -1.0));
    let correlation = |a: &[f64], b: &[f64]| {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let dot = |x: &[f64], mx: f64, y: &[f64], my: f64| -> f64 {
            x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
        };
        dot(a, ma, b, mb) / (dot(a, ma, a, ma) * dot(b, mb, b, mb)).sqrt()
    };
    let alike = correlation(&a, &b);
    let shifted = correlation(&a[..380], &b[20..]);
    assert!(alike > 0.8, "{alike}");
    assert!(shifted < 0.5, "{shifted}");
    // Far from the posters the pictures are the same.
    assert_eq!(plain.path(), twins.path());
    // The boards come last, so that these skins serve the scene without them as well.
    let away = (0..plain.images())
        .find(|&k| {
            [north, south].iter().all(|p| {
                let [x, y, _] = *p;
                (-4..5).all(|i| {
                    (-6..7).all(|j| {
                        let point = nalgebra::Point3::new(
                            x + 0.1 * f64::from(i),
                            y,
                            0.95 + 0.1 * f64::from(j),
                        );
                        twins.project(k, &point).is_none()
                    })
                })
            })
        })
        .unwrap();
    assert_eq!(plain.render(&skins, away), twins.render(&skins, away));
}

#[test]
fn a_walker_hides_the_wall_where_its_truth_says_and_nowhere_else() {
    let spec = SceneSpec {
        frames: 80,
        ..SceneSpec::room(3)
    };
    let mishaps = Mishaps {
        walker: true,
        ..Mishaps::default()
    };
    let (empty, walked) = (scene(spec), scene(SceneSpec { mishaps, ..spec }));
    let nearer = |frame: usize, u: usize, v: usize| {
        let depth = |scene: &Scene| scene.depth_at(frame, u as f64, v as f64).unwrap();
        depth(&walked) < depth(&empty) - 0.05
    };
    let middle: Vec<usize> = (0..80).filter(|&frame| nearer(frame, 160, 120)).collect();
    assert!(
        (2..40).contains(&middle.len()),
        "the walker passes: {middle:?}"
    );
    let frame = middle[middle.len() / 2];
    // The faces of the block come last, so that these skins serve the empty scene as well.
    let skins = walked.skins();
    let (a, b) = (empty.render(&skins, frame), walked.render(&skins, frame));
    let hidden: Vec<bool> = (0..320 * 240)
        .map(|k| nearer(frame, k % 320, k / 320))
        .collect();
    let on = difference(&a, &b, |u, v| hidden[v * 320 + u]);
    // The lens blurs the edge of the block.
    let off = difference(&a, &b, |u, v| {
        (0..7).all(|d| !hidden[v * 320 + (u + d).saturating_sub(3).min(319)])
    });
    assert!(on > 15.0, "{on}");
    assert!(off < 0.1, "{off}");
}

#[test]
fn the_folder_says_in_words_what_happened_and_makes_the_same_scene_again() {
    let spec = SceneSpec {
        twin_posters: true,
        mishaps: Mishaps {
            kidnap: Some(Kidnap {
                frame: 3,
                metres: 0.5,
            }),
            dark: Some(FrameSpan { from: 1, to: 2 }),
            blocked: Some(FrameSpan { from: 4, to: 5 }),
            shutter_s: 0.04,
            walker: true,
        },
        ..SceneSpec {
            frames: 4,
            ..SceneSpec::wall(8)
        }
        .with_stops(Stops {
            pause: Some(Stop {
                every: 2,
                frames: 1,
            }),
            spin: Some(Stop {
                every: 3,
                frames: 8,
            }),
        })
    };
    assert_eq!(spec.frames, 4 + 1 + 8);
    let folder = std::env::temp_dir().join(format!("scene-happenings-{}", std::process::id()));
    let written = scene(spec);
    written.write(&folder).unwrap();
    let text = std::fs::read_to_string(folder.join("scene.json")).unwrap();
    let again = Scene::read(&folder.join("scene.json")).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(again.spec(), written.spec());
    assert_eq!(again.path(), written.path());
    for sentence in [
        "after every 2 frames of driving the robot stands still for 1 frames",
        "after every 3 frames of driving the robot turns once around on the spot in 8 frames",
        "two boards in different places carry the same poster",
        "just before frame 3 the robot is lifted and set down 0.5 m away; the odometry does not know",
        "from frame 1 until before frame 2 no light reaches the sensor",
        "from frame 4 until before frame 5 the lens is covered",
        "the shutter is open for 0.04 s about the time of each image",
        "a person-sized block walks between the robot and the walls",
        "centre of the block at each image",
    ] {
        assert!(text.contains(sentence), "{sentence}");
    }
}

#[test]
fn impossible_happenings_are_refused_with_the_number_given() {
    let spec = SceneSpec::room(1);
    let with = |mishaps: Mishaps| SceneSpec { mishaps, ..spec };
    let kidnap = |frame, metres| {
        with(Mishaps {
            kidnap: Some(Kidnap { frame, metres }),
            ..Mishaps::default()
        })
    };
    let pause = |every, frames| SceneSpec {
        stops: Stops {
            pause: Some(Stop { every, frames }),
            spin: None,
        },
        ..spec
    };
    for (spec, expected) in [
        (
            kidnap(0, 1.0),
            "frame of the kidnapping 0, required: 1 to 184",
        ),
        (kidnap(5, f64::NAN), "distance of the kidnapping NaN"),
        (pause(0, 5), "frames between pauses 0, required: 1 to"),
        (
            pause(5, usize::MAX),
            "frames of a pause 1.84467e19, required: 1 to 40000",
        ),
        (
            with(Mishaps {
                dark: Some(FrameSpan { from: 9, to: 9 }),
                ..Mishaps::default()
            }),
            "end of the dark frames 9, required: 10 to 186",
        ),
        (
            with(Mishaps {
                shutter_s: 2.0,
                ..Mishaps::default()
            }),
            "time of the shutter 2, required: 0 to 0.5",
        ),
    ] {
        let message = Scene::new(spec).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}
