//! Whether the camera of a run is the one that made the map in which it begins.
//!
//! Landmarks are kept as rays of the camera that saw them, so another calibration bends the map. Two cameras are compared
//! by what they do: a grid of pixels of the one is taken back to rays, and the other says where it sees these rays.

use mono_geometry::Camera;
use nalgebra::{Vector2, Vector3};
use slam_io::Warning;

/// Pixels by which two cameras may differ: less than any keypoint is found to.
const ROUNDING_PX: f64 = 0.01;
/// Points of the grid along each axis.
const GRID: usize = 9;

/// A warning with numbers where `camera` sees a ray of the map's camera elsewhere in the image.
#[must_use]
pub fn of_map(map: &Camera, camera: &Camera) -> Option<Warning> {
    let (old, new) = (map.pinhole(), camera.pinhole());
    let told = |difference: String| {
        Some(Warning::new(
            "map-camera-differs",
            format!(
                "The map was made with another camera: {difference}; its landmarks are seen where they are not, unless the \
                 map is made again with this calibration."
            ),
        ))
    };
    if (old.width, old.height) != (new.width, new.height) {
        return told(format!(
            "its images had {} x {} pixels, these have {} x {}",
            old.width, old.height, new.width, new.height
        ));
    }
    let largest = grid(old.width, old.height)
        .filter_map(|pixel| {
            let ray = map.undistort(&pixel).ok()?;
            // A ray that this camera does not see differs by as much as any.
            let seen = camera.project(&Vector3::new(ray.x, ray.y, 1.0));
            Some(seen.map_or(f64::INFINITY, |seen| (seen - pixel).norm()))
        })
        .fold(0.0, f64::max);
    if largest <= ROUNDING_PX {
        return None;
    }
    let lens = |camera: &Camera| {
        camera
            .parameter_names()
            .iter()
            .zip(camera.parameters().iter())
            .map(|(name, value)| format!("{name} {value}"))
            .collect::<Vec<_>>()
    };
    let (ours, theirs) = (lens(camera), lens(map));
    let changed: Vec<String> = theirs
        .iter()
        .filter(|value| !ours.contains(value))
        .cloned()
        .collect();
    let now: Vec<String> = ours
        .iter()
        .filter(|value| !theirs.contains(value))
        .cloned()
        .collect();
    let by = if largest.is_finite() {
        format!("up to {largest:.2} px apart")
    } else {
        "partly out of sight".to_owned()
    };
    told(format!(
        "the same rays are {by} ({} then, {} now)",
        changed.join(", "),
        now.join(", ")
    ))
}

/// Pixels over the whole image, its border included.
fn grid(width: usize, height: usize) -> impl Iterator<Item = Vector2<f64>> {
    let place = |index: usize, side: usize| (side as f64 - 1.0) * index as f64 / (GRID - 1) as f64;
    (0..GRID * GRID)
        .map(move |index| Vector2::new(place(index % GRID, width), place(index / GRID, height)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::{Distortion, Pinhole};

    fn camera(fx: f64, width: usize, k1: f64) -> Camera {
        let pinhole = Pinhole {
            width,
            height: 240,
            fx,
            fy: 300.0,
            cx: 160.0,
            cy: 120.0,
        };
        let lens = Distortion::Radtan {
            k1,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        };
        Camera::new(pinhole, lens).expect("a camera")
    }

    #[test]
    fn only_what_moves_pixels_is_another_camera() {
        let of = |fx, width, k1| of_map(&camera(300.0, 320, -0.1), &camera(fx, width, k1));
        assert_eq!(of(300.0, 320, -0.1), None);
        // A calibration written with fewer digits.
        assert_eq!(of(300.000_01, 320, -0.1), None);
        let longer = of(303.0, 320, -0.1).expect("another lens");
        assert_eq!(longer.name, "map-camera-differs");
        // One per cent of the largest distance from the axis, 160 px.
        assert!(
            longer
                .message
                .contains("the same rays are up to 1.60 px apart (fx 300 then, fx 303 now)"),
            "{longer}"
        );
        let bent = of(300.0, 320, -0.12).expect("another lens");
        assert!(
            bent.message.contains("(k1 -0.1 then, k1 -0.12 now)"),
            "{bent}"
        );
        let larger = of(300.0, 640, -0.1).expect("another sensor");
        assert!(
            larger
                .message
                .contains("its images had 320 x 240 pixels, these have 640 x 240;"),
            "{larger}"
        );
    }
}
