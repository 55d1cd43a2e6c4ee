//! Saddles of the grey levels: where four squares meet.
//!
//! Problem: find every place that could be an inner corner of a checkerboard, at any turn and under any light.
//!
//! Around such a corner the blurred image is a saddle: its Hessian H has one positive and one negative eigenvalue. The
//! response is sqrt(-det H) = sqrt(I_xy^2 - I_xx I_yy), zero on flat areas, on straight edges and on blobs
//! (Geiger, Moosmann, Car and Schuster, ICRA 2012, name the same structure; the determinant is Beaudet's, 1978). For
//! squares of contrast C whose edges are blurred to standard deviation s it is C / (pi s^2) at the corner.
//!
//! Steps: Gaussian of one pixel; response from second differences; local maxima in a window of 7 x 7 above
//! [`RESPONSE_FLOOR`] and above a share of what a board would show; the saddle's place by one Newton step,
//! -H^-1 g, which is good to about 0.1 px.
//!
//! Degenerate: a saddle wider than a few pixels (blurred or very large images) has next to no response; the caller
//! looks at coarser levels of a pyramid.

use super::plane::Plane;

/// Smallest response believed, grey levels a squared pixel: twice the noise of an image with a noise of 8 levels.
const RESPONSE_FLOOR: f32 = 2.0;
/// Share of the n-th strongest response (n corners of the board) below which nothing is kept: light is uneven, but not by 15.
const RESPONSE_SHARE: f32 = 0.07;
/// Half width of the window in which a maximum must be alone, pixels.
const ALONE_WITHIN: usize = 3;
/// Most maxima looked at, the strongest: bounds the time on pictures full of texture.
const MOST_CANDIDATES: usize = 3000;

/// The response at every pixel, zero on the rim. `blurred` is the plane after [`Plane::blurred`].
pub(super) fn response(blurred: &Plane) -> Plane {
    let (width, height) = (blurred.width, blurred.height);
    let mut values = vec![0.0; width * height];
    for y in 1..height.saturating_sub(1) {
        let rows: [&[f32]; 3] =
            std::array::from_fn(|k| &blurred.values[(y + k - 1) * width..][..width]);
        for x in 1..width.saturating_sub(1) {
            let [xx, xy, yy] = second_differences(rows, x);
            values[y * width + x] = (xy * xy - xx * yy).max(0.0).sqrt();
        }
    }
    Plane {
        width,
        height,
        values,
    }
}

fn second_differences(rows: [&[f32]; 3], x: usize) -> [f32; 3] {
    let [above, here, below] = rows;
    let centre = 2.0 * here[x];
    [
        here[x + 1] - centre + here[x - 1],
        0.25 * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]),
        below[x] - centre + above[x],
    ]
}

/// Places of the strongest saddles, strongest first; `wanted` corners are on the board.
pub(super) fn maxima(response: &Plane, wanted: usize) -> Vec<(usize, usize)> {
    let (width, height) = (response.width, response.height);
    let rim = ALONE_WITHIN + 1;
    let mut found: Vec<(f32, usize)> = Vec::new();
    for y in rim..height.saturating_sub(rim) {
        for x in rim..width.saturating_sub(rim) {
            let value = response.at(x, y);
            if value >= RESPONSE_FLOOR && is_maximum(response, x, y) {
                found.push((value, y * width + x));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let reference = found
        .get(wanted.saturating_sub(1))
        .map_or(0.0, |entry| entry.0);
    found.truncate(MOST_CANDIDATES);
    found.retain(|entry| entry.0 >= RESPONSE_SHARE * reference);
    found
        .into_iter()
        .map(|(_, place)| (place % width, place / width))
        .collect()
}

/// Strictly above the pixels before it and not below those after it, so that one of equals is kept.
pub(super) fn is_maximum(response: &Plane, x: usize, y: usize) -> bool {
    let value = response.at(x, y);
    for j in y - ALONE_WITHIN..=y + ALONE_WITHIN {
        let row = &response.values[j * response.width..][..response.width];
        for i in x - ALONE_WITHIN..=x + ALONE_WITHIN {
            let before = (j, i) < (y, x);
            if row[i] > value || (before && row[i] == value) {
                return false;
            }
        }
    }
    true
}

/// Where the gradient vanishes next to pixel (x, y); the pixel itself when that is further than 1.5 px away.
pub(super) fn saddle_point(blurred: &Plane, x: usize, y: usize) -> [f64; 2] {
    let rows: [&[f32]; 3] =
        std::array::from_fn(|k| &blurred.values[(y + k - 1) * blurred.width..][..blurred.width]);
    let [xx, xy, yy] = second_differences(rows, x).map(f64::from);
    let gx = 0.5 * f64::from(rows[1][x + 1] - rows[1][x - 1]);
    let gy = 0.5 * f64::from(rows[2][x] - rows[0][x]);
    let determinant = xx * yy - xy * xy;
    let step = [
        -(yy * gx - xy * gy) / determinant,
        -(xx * gy - xy * gx) / determinant,
    ];
    if step.iter().all(|part| part.abs() <= 1.5) {
        [x as f64 + step[0], y as f64 + step[1]]
    } else {
        [x as f64, y as f64]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast 100 between four quadrants meeting at (20.3, 15.8), edges of standard deviation about 1.
    fn quadrants() -> Plane {
        let soft = |d: f64| (1.6 * d).tanh();
        let values = (0..40 * 32)
            .map(|k| {
                let (x, y) = (f64::from(k % 40) - 20.3, f64::from(k / 40) - 15.8);
                (120.0 + 50.0 * soft(x) * soft(y)) as f32
            })
            .collect();
        Plane {
            width: 40,
            height: 32,
            values,
        }
    }

    #[test]
    fn a_corner_is_one_maximum_and_its_place_is_found() {
        let blurred = quadrants().blurred();
        let response = response(&blurred);
        let found = maxima(&response, 1);
        assert_eq!(found, [(20, 16)]);
        let [x, y] = saddle_point(&blurred, 20, 16);
        assert!((x - 20.3).abs() < 0.1 && (y - 15.8).abs() < 0.1, "{x} {y}");
    }

    #[test]
    fn edges_and_blobs_have_no_response() {
        let plane = |value: fn(f64, f64) -> f64| Plane {
            width: 40,
            height: 32,
            values: (0..40 * 32)
                .map(|k| value(f64::from(k % 40) - 20.3, f64::from(k / 40) - 15.8) as f32)
                .collect(),
        };
        let edge = plane(|x, y| 100.0 * (0.6 * (x + 0.7 * y)).tanh());
        let blob = plane(|x, y| 200.0 * (-(x * x + y * y) / 8.0).exp());
        assert!(maxima(&response(&edge.blurred()), 1).is_empty());
        // Far out on its flank a blob curves both ways, weakly: nothing at its centre.
        assert_eq!(response(&blob.blurred()).at(20, 16), 0.0);
    }
}
