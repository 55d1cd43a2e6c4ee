//! Pictures with known answers, drawn by formula.

use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};

/// A grey picture and its size.
#[derive(Debug)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<u8>,
}

impl Picture {
    /// Draws `grey(x, y)` at every pixel centre, rounded and cut to bytes.
    pub(crate) fn draw(width: usize, height: usize, grey: impl Fn(f64, f64) -> f64) -> Self {
        let value = |i: usize| {
            grey((i % width) as f64, (i / width) as f64)
                .round()
                .clamp(0.0, 255.0) as u8
        };
        Self {
            width,
            height,
            pixels: (0..width * height).map(value).collect(),
        }
    }

    pub(crate) fn view(&self) -> GrayImage<'_> {
        GrayImage::new(self.width, self.height, &self.pixels)
            .expect("test pictures are large enough")
    }

    /// The sum of all grey values.
    pub(crate) fn sum(&self) -> u64 {
        self.pixels.iter().map(|&p| u64::from(p)).sum()
    }

    pub(crate) fn transposed(&self) -> Self {
        let pixels = (0..self.pixels.len())
            .map(|i| self.pixels[(i % self.height) * self.width + i / self.height]);
        Self {
            width: self.height,
            height: self.width,
            pixels: pixels.collect(),
        }
    }

    /// A quarter turn: the pixel `(x, y)` goes to `(height - 1 - y, x)`, the x axis to the y axis.
    pub(crate) fn quarter_turned(&self) -> Self {
        let (w, h) = (self.height, self.width);
        let pixels =
            (0..w * h).map(|i| self.pixels[(self.height - 1 - i % w) * self.width + i / w]);
        Self {
            width: w,
            height: h,
            pixels: pixels.collect(),
        }
    }

    pub(crate) fn mapped(&self, f: impl Fn(u8) -> u8) -> Self {
        Self {
            width: self.width,
            height: self.height,
            pixels: self.pixels.iter().map(|&p| f(p)).collect(),
        }
    }
}

/// A Gaussian spot of height 1.
pub(crate) fn spot(x: f64, y: f64, centre: (f64, f64), sigma: f64) -> f64 {
    (-((x - centre.0).powi(2) + (y - centre.1).powi(2)) / (2.0 * sigma * sigma)).exp()
}

/// A smooth scene without symmetry in continuous coordinates: 500 spots of both signs, cut off at 6 sigma.
/// The same integer generator is in `reference/opencv_sift.py`.
pub(crate) fn scene(x: f64, y: f64, side: f64) -> f64 {
    let mut state = 2004_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65_536.0
    };
    let mut sum = 0.0;
    for _ in 0..500 {
        let (u, v, s, a) = (
            next() * side,
            next() * side,
            1.2 + 5.0 * next().powi(2),
            160.0 * (next() - 0.5),
        );
        if (x - u).powi(2) + (y - v).powi(2) < 36.0 * s * s {
            sum += a * spot(x, y, (u, v), s);
        }
    }
    128.0 + sum
}

pub(crate) fn detect_with(picture: &Picture, params: SiftParams) -> Features {
    let mut features = Features::default();
    Detector::new(params)
        .expect("test parameters are in range")
        .detect(&picture.view(), &mut Workspace::new(), &mut features)
        .expect("checked input");
    features
}

pub(crate) fn detect(picture: &Picture) -> Features {
    vision_sift::detect(&picture.view()).expect("checked input")
}

/// Difference of two angles in `[-pi, pi)`.
pub(crate) fn angle_between(a: f32, b: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    (a - b + PI).rem_euclid(TAU) - PI
}

pub(crate) fn descriptor_distance(a: &[u8; 128], b: &[u8; 128]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(&p, &q)| (f32::from(p) - f32::from(q)).powi(2))
        .sum::<f32>()
        .sqrt()
}

/// Share of the features of `a` that have one in `b` at `map(x, y)`, `turn` later in angle and `scale` larger, within
/// half a pixel, 10 % in scale and 0.1 radians; and the median descriptor distance of those pairs.
pub(crate) fn agreement(
    a: &Features,
    b: &Features,
    map: impl Fn(f32, f32) -> (f32, f32),
    turn: f32,
    scale: f32,
) -> (f64, f32) {
    let mut distances = Vec::new();
    for (k, d) in a.keypoints.iter().zip(&a.descriptors) {
        let (x, y) = map(k.x, k.y);
        let near = b.keypoints.iter().zip(&b.descriptors).filter(|(q, _)| {
            (q.x - x).hypot(q.y - y) < 0.5
                && (q.sigma / (k.sigma * scale)).ln().abs() < 0.1
                && angle_between(q.angle, k.angle + turn).abs() < 0.1
        });
        if let Some(best) = near
            .map(|(_, e)| descriptor_distance(d, e))
            .min_by(f32::total_cmp)
        {
            distances.push(best);
        }
    }
    distances.sort_by(f32::total_cmp);
    let share = distances.len() as f64 / a.keypoints.len() as f64;
    (
        share,
        distances
            .get(distances.len() / 2)
            .copied()
            .unwrap_or(f32::INFINITY),
    )
}

/// The sum of grey values that the first line of a reference file states.
pub(crate) fn stated_sum(reference: &str) -> u64 {
    let after = reference.split("grey values ").nth(1).unwrap();
    after.split(',').next().unwrap().parse().unwrap()
}
