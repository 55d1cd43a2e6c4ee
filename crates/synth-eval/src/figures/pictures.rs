//! Keypoints at two distances and matches between two images, in the manner of the paper's Fig. 2 and 3.

use anyhow::Context;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use feature_kdtree::match_mutual;
use slam_io::GreyImage;
use slam_pipeline::config::Config;
use std::fmt::Write as _;
use vision_sift::{Features, Keypoint};
use wall_scenes::{Scene, SceneSpec, Skins};

use crate::recording::detect;

/// Pixels of the drawing for each of an image.
const ZOOM: f64 = 1.9;
/// Room between two images, pixels of an image.
const GAP_PX: f64 = 8.0;
/// Images of the room that are looked at for the nearest and the farthest view.
const LOOK_EVERY: usize = 6;
/// Keypoints drawn in an image, the strongest.
const MOST_RINGS: usize = 200;
/// Images from the first matched one to the second.
const MATCHED_STEP: usize = 4;
/// Largest distance of the surface points of a right match, metres.
const SAME_POINT_M: f64 = 0.03;
/// Ratio of the match, Eq. 21.
const RATIO: f32 = 0.8;

/// An image with its keypoints.
struct Picture {
    /// Index of its frame.
    frame: usize,
    image: GreyImage,
    features: Features,
}

/// A scene ready to be looked at.
struct Studio {
    scene: Scene,
    skins: Skins,
}

impl Studio {
    fn new(spec: SceneSpec) -> anyhow::Result<Self> {
        let scene = Scene::new(spec)?;
        let skins = scene.skins();
        Ok(Self { scene, skins })
    }

    fn picture(&self, index: usize) -> anyhow::Result<Picture> {
        let image = self.scene.render(&self.skins, index);
        let (width, height, pixels) = (image.width, image.height, image.pixels);
        let shown = pixels.clone();
        let (mut features, _) = detect(&Config::default(), 1, |_| {
            Ok((width, height, pixels.clone()))
        })?;
        Ok(Picture {
            frame: index,
            image: GreyImage {
                width,
                height,
                pixels: shown,
            },
            features: features.pop().context("an image without features")?,
        })
    }

    /// Median depth of an image, metres.
    fn depth_m(&self, index: usize) -> f64 {
        let mut depths: Vec<f64> = (0..8 * 6)
            .filter_map(|k| {
                let (u, v) = (
                    f64::from(k % 8) * 40.0 + 20.0,
                    f64::from(k / 8) * 40.0 + 20.0,
                );
                self.scene.depth_at(index, u, v)
            })
            .collect();
        depths.sort_by(f64::total_cmp);
        depths.get(depths.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Fig. 2: the keypoints of the nearest and of the farthest view of a room.
///
/// # Errors
/// The scene cannot be built.
pub(super) fn two_distances(seed: u64) -> anyhow::Result<String> {
    let studio = Studio::new(SceneSpec::room(seed))?;
    let looked_at = || (0..studio.scene.images()).step_by(LOOK_EVERY);
    let by_depth = |a: &usize, b: &usize| studio.depth_m(*a).total_cmp(&studio.depth_m(*b));
    let nearest = looked_at().min_by(by_depth).unwrap_or(0);
    let farthest = looked_at().max_by(by_depth).unwrap_or(0);
    let pictures = [studio.picture(nearest)?, studio.picture(farthest)?];
    let mut overlay = String::new();
    let mut captions = Vec::new();
    for (place, picture) in pictures.iter().enumerate() {
        let left = place as f64 * (picture.image.width as f64 + GAP_PX);
        let mut strongest: Vec<&Keypoint> = picture.features.keypoints.iter().collect();
        strongest.sort_by(|a, b| b.response.abs().total_cmp(&a.response.abs()));
        let path: String = strongest
            .iter()
            .take(MOST_RINGS)
            .map(|keypoint| ring(keypoint, left))
            .collect();
        let _ = write!(
            overlay,
            "<path d=\"{path}\" fill=\"none\" stroke=\"#45e08a\" stroke-width=\"0.6\"/>"
        );
        captions.push(format!(
            "{} keypoints, {:.1} m",
            picture.features.keypoints.len(),
            studio.depth_m(picture.frame)
        ));
    }
    side_by_side(&pictures, &overlay, &captions)
}

/// Fig. 3: the mutual matches of two images of the wall, right ones green and wrong ones red.
///
/// # Errors
/// The scene cannot be built.
pub(super) fn matches(seed: u64) -> anyhow::Result<String> {
    let studio = Studio::new(SceneSpec::wall(seed))?;
    let (first, second) = (10, 10 + MATCHED_STEP);
    let pictures = [studio.picture(first)?, studio.picture(second)?];
    let [a, b] = &pictures;
    let found = match_mutual(&a.features.descriptors, &b.features.descriptors, RATIO)?;
    let shift = a.image.width as f64 + GAP_PX;
    let (mut right, mut wrong) = (String::new(), String::new());
    let (mut right_count, mut wrong_count) = (0, 0);
    for pair in &found {
        let from = &a.features.keypoints[pair.query as usize];
        let to = &b.features.keypoints[pair.id as usize];
        let see = |image, keypoint: &Keypoint| {
            studio
                .scene
                .point_at(image, f64::from(keypoint.x), f64::from(keypoint.y))
        };
        let same = see(first, from)
            .zip(see(second, to))
            .is_some_and(|(p, q)| (p - q).norm() < SAME_POINT_M);
        let line = format!(
            "M{:.1} {:.1}L{:.1} {:.1}",
            from.x,
            from.y,
            f64::from(to.x) + shift,
            to.y
        );
        if same {
            right_count += 1;
            right += &line;
        } else {
            wrong_count += 1;
            wrong += &line;
        }
    }
    let overlay = format!(
        "<path d=\"{right}\" fill=\"none\" stroke=\"#45e08a\" stroke-width=\"0.4\" stroke-opacity=\"0.55\"/>\
         <path d=\"{wrong}\" fill=\"none\" stroke=\"#ff5a6a\" stroke-width=\"0.9\"/>"
    );
    let driven = format!("{:.1} m further on", 0.1 * MATCHED_STEP as f64);
    let counts = format!("{right_count} right matches, {wrong_count} wrong");
    side_by_side(&pictures, &overlay, &[counts, driven])
}

/// A circle of three times the keypoint's scale, with its orientation.
fn ring(keypoint: &Keypoint, left: f64) -> String {
    let (x, y) = (f64::from(keypoint.x) + left, f64::from(keypoint.y));
    let radius = 3.0 * f64::from(keypoint.sigma);
    let (sin, cos) = f64::from(keypoint.angle).sin_cos();
    format!(
        "M{:.1} {y:.1}a{radius:.1} {radius:.1} 0 1 0 {d:.1} 0a{radius:.1} {radius:.1} 0 1 0 -{d:.1} 0M{x:.1} {y:.1}l{:.1} {:.1}",
        x - radius,
        radius * cos,
        radius * sin,
        d = 2.0 * radius
    )
}

/// Images beside one another with a drawing over them and a caption under each.
fn side_by_side(
    pictures: &[Picture],
    overlay: &str,
    captions: &[String],
) -> anyhow::Result<String> {
    let (mut body, mut left, mut bottom) = (String::new(), 0.0, 0.0_f64);
    for (picture, caption) in pictures.iter().zip(captions) {
        let (width, height) = (picture.image.width as f64, picture.image.height as f64);
        let png = STANDARD.encode(picture.image.png().context("an image without pixels")?);
        let _ = write!(
            body,
            "<image href=\"data:image/png;base64,{png}\" x=\"{:.1}\" y=\"-0.5\" width=\"{width}\" height=\"{height}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"9\" font-family=\"system-ui, sans-serif\" fill=\"#16202c\">{caption}</text>",
            left - 0.5,
            left + width / 2.0,
            height + 11.0
        );
        left += width + GAP_PX;
        bottom = bottom.max(height + 16.0);
    }
    let width = left - GAP_PX;
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" viewBox=\"-0.5 -0.5 {width:.0} {bottom:.0}\" role=\"img\">\
         <rect x=\"-0.5\" y=\"-0.5\" width=\"100%\" height=\"100%\" fill=\"#fff\"/>{body}{overlay}</svg>\n",
        width * ZOOM,
        bottom * ZOOM
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_has_three_scales_and_points_along_its_angle() {
        let keypoint = Keypoint {
            x: 10.0,
            y: 20.0,
            sigma: 2.0,
            angle: std::f32::consts::FRAC_PI_2,
            response: 0.1,
        };
        let path = ring(&keypoint, 100.0);
        assert!(path.starts_with("M104.0 20.0a6.0 6.0"), "{path}");
        assert!(path.ends_with("M110.0 20.0l-0.0 6.0"), "{path}");
    }
}
