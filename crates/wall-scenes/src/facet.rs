//! The solid scene: axis-aligned rectangles, and rays against them.
//!
//! A [`Facet`] is a rectangle on a plane `x[axis] = offset`, seen from one side only. The nearest facet along a ray
//! wins; ties go to the lower index, so that the answer does not depend on the order of work.

use nalgebra::{Point3, Vector3};

/// A one-sided axis-aligned rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Facet {
    /// Axis of the normal: 0, 1 or 2 for x, y, z.
    pub(crate) axis: usize,
    /// Sign of the normal along that axis: the side it is seen from.
    pub(crate) normal_sign: f64,
    /// Coordinate of the plane, metres.
    pub(crate) offset: f64,
    /// Lower corner along the two other axes, in their cyclic order after `axis`.
    pub(crate) low: [f64; 2],
    /// Upper corner.
    pub(crate) high: [f64; 2],
}

/// The point at which a ray meets the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    /// Ray parameter; the depth when the ray direction has unit camera z.
    pub(crate) distance: f64,
    /// Index of the facet.
    pub(crate) facet: usize,
}

impl Facet {
    /// The two axes that span the facet.
    fn axes(&self) -> (usize, usize) {
        ((self.axis + 1) % 3, (self.axis + 2) % 3)
    }

    /// Width and height in metres as the viewer sees them (height along z; for a
    /// level facet along y).
    pub(crate) fn size(&self) -> (f64, f64) {
        let spans = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        // Axis x: (y, z); axis y: (z, x); axis z: (x, y).
        if self.axis == 1 {
            (spans[1], spans[0])
        } else {
            (spans[0], spans[1])
        }
    }

    /// Position on the skin: metres from the top-left corner as the viewer sees it.
    pub(crate) fn skin_position(&self, point: &Point3<f64>) -> (f64, f64) {
        match self.axis {
            // Seen against +x (normal -1) the viewer's right is -y.
            0 if self.normal_sign < 0.0 => (self.high[0] - point.y, self.high[1] - point.z),
            0 => (point.y - self.low[0], self.high[1] - point.z),
            // Seen against +y the viewer's right is +x.
            1 if self.normal_sign < 0.0 => (point.x - self.low[1], self.high[0] - point.z),
            1 => (self.high[1] - point.x, self.high[0] - point.z),
            _ => (point.x - self.low[0], self.high[1] - point.y),
        }
    }

    /// World point at a position on the skin: the inverse of [`Self::skin_position`].
    pub(crate) fn skin_point(&self, x: f64, y: f64) -> Point3<f64> {
        let [low, high] = [self.low, self.high];
        match (self.axis, self.normal_sign < 0.0) {
            (0, true) => Point3::new(self.offset, high[0] - x, high[1] - y),
            (0, false) => Point3::new(self.offset, low[0] + x, high[1] - y),
            (1, true) => Point3::new(low[1] + x, self.offset, high[0] - y),
            (1, false) => Point3::new(high[1] - x, self.offset, high[0] - y),
            _ => Point3::new(low[0] + x, high[1] - y, self.offset),
        }
    }

    /// Ray parameter at which a ray meets the front of the facet.
    fn meet(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let slope = direction[self.axis];
        if slope * self.normal_sign >= 0.0 {
            return None;
        }
        let distance = (self.offset - origin[self.axis]) / slope;
        if distance <= 0.0 {
            return None;
        }
        let (a, b) = self.axes();
        let pa = origin[a] + distance * direction[a];
        let pb = origin[b] + distance * direction[b];
        let inside =
            pa >= self.low[0] && pa <= self.high[0] && pb >= self.low[1] && pb <= self.high[1];
        inside.then_some(distance)
    }

    /// The four corners in the world, around the rectangle.
    pub(crate) fn corners(&self) -> [Point3<f64>; 4] {
        let (a, b) = self.axes();
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
            let mut corner = Point3::origin();
            corner[self.axis] = self.offset;
            corner[a] = if i == 0 { self.low[0] } else { self.high[0] };
            corner[b] = if j == 0 { self.low[1] } else { self.high[1] };
            corner
        })
    }
}

/// Nearest of the candidate facets along a ray; `None` when it meets none of them. O(candidates).
pub(crate) fn nearest(
    facets: &[Facet],
    candidates: impl Iterator<Item = usize>,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for facet in candidates {
        if let Some(distance) = facets[facet].meet(origin, direction)
            && best.is_none_or(|hit| distance < hit.distance)
        {
            best = Some(Hit { distance, facet });
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facet_is_seen_from_its_own_side_only() {
        let facet = Facet {
            axis: 1,
            normal_sign: -1.0,
            offset: 2.0,
            low: [0.0, -1.0],
            high: [1.0, 1.0],
        };
        let eye = Point3::new(0.0, 0.0, 0.5);
        assert_eq!(facet.meet(&eye, &Vector3::y()), Some(2.0));
        assert_eq!(
            facet.meet(&Point3::new(0.0, 4.0, 0.5), &-Vector3::y()),
            None
        );
        assert_eq!(facet.meet(&eye, &Vector3::new(1.0, 1.0, 0.0)), None);
    }

    #[test]
    fn skins_read_left_to_right_from_every_side() {
        // For each upright facet, a step to the viewer's right must raise the skin's x.
        for (axis, normal_sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
            let facet = Facet {
                axis,
                normal_sign,
                offset: 0.0,
                low: [-1.0; 2],
                high: [1.0; 2],
            };
            let mut view = Vector3::zeros();
            view[axis] = -normal_sign;
            let right = view.cross(&Vector3::z());
            let (x0, y0) = facet.skin_position(&Point3::origin());
            let (x1, y1) = facet.skin_position(&Point3::from(right * 0.5));
            assert!((x1 - x0 - 0.5).abs() < 1e-12 && (y1 - y0).abs() < 1e-12);
            let (_, above) = facet.skin_position(&Point3::new(0.0, 0.0, 0.5));
            assert!((y0 - above - 0.5).abs() < 1e-12);
            let back = facet.skin_point(x1, y1);
            assert!((back.coords - right * 0.5).norm() < 1e-12);
        }
    }
}
