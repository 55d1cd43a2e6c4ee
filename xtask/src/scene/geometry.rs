//! The solid scene: axis-aligned rectangles with skins, and rays against them.
//!
//! A [`Facet`] is a rectangle on a plane `x[axis] = offset`, seen from one side
//! only. A box is five or six facets. The nearest facet along a ray wins; ties
//! go to the lower index, so the answer does not depend on the order of work.
//! For whole images each facet is first projected to the cells of a screen grid it can
//! touch (`ScreenIndex`), which leaves a handful of candidates for a ray.

use super::camera::{HEIGHT, WIDTH, project};
use super::paint::Paint;
use nalgebra::{Isometry3, Point3, Vector3};

/// Pixels along the edge of a screen cell.
const CELL_PX: usize = 16;
const CELL_COLUMNS: usize = WIDTH.div_ceil(CELL_PX);
const CELL_ROWS: usize = HEIGHT.div_ceil(CELL_PX);
/// Corners nearer than this (metres) cannot be projected safely.
const NEAR_M: f64 = 0.05;

/// A one-sided axis-aligned rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet {
    /// Axis of the normal: 0, 1 or 2 for x, y, z.
    pub axis: usize,
    /// Sign of the normal along that axis: the side it is seen from.
    pub normal_sign: f64,
    /// Coordinate of the plane, metres.
    pub offset: f64,
    /// Lower corner along the two other axes, in their cyclic order after `axis`.
    pub low: [f64; 2],
    /// Upper corner.
    pub high: [f64; 2],
}

/// Where a ray meets the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Ray parameter; the depth when the ray direction has unit camera z.
    pub distance: f64,
    /// Index of the facet.
    pub facet: usize,
}

/// Facets and what to paint on them, index by index.
#[derive(Debug, Clone, Default)]
pub struct World {
    pub(super) facets: Vec<Facet>,
    pub(super) paints: Vec<Paint>,
}

/// Facets that may be seen in each cell of the screen.
#[derive(Debug, Clone)]
pub(super) struct ScreenIndex {
    cells: Vec<Vec<u32>>,
}

impl Facet {
    /// The two axes that span the facet.
    fn axes(&self) -> (usize, usize) {
        ((self.axis + 1) % 3, (self.axis + 2) % 3)
    }

    /// Width and height in metres as the viewer sees them (height along z; for a
    /// level facet along y).
    pub(super) fn size(&self) -> (f64, f64) {
        let spans = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        // Axis x: (y, z); axis y: (z, x); axis z: (x, y).
        if self.axis == 1 {
            (spans[1], spans[0])
        } else {
            (spans[0], spans[1])
        }
    }

    /// Position on the skin: metres from the top-left corner as the viewer sees it.
    pub(super) fn skin_position(&self, point: &Point3<f64>) -> (f64, f64) {
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
    pub(super) fn skin_point(&self, x: f64, y: f64) -> Point3<f64> {
        let [low, high] = [self.low, self.high];
        match (self.axis, self.normal_sign < 0.0) {
            (0, true) => Point3::new(self.offset, high[0] - x, high[1] - y),
            (0, false) => Point3::new(self.offset, low[0] + x, high[1] - y),
            (1, true) => Point3::new(low[1] + x, self.offset, high[0] - y),
            (1, false) => Point3::new(high[1] - x, self.offset, high[0] - y),
            _ => Point3::new(low[0] + x, high[1] - y, self.offset),
        }
    }

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

    fn corners(&self) -> [Point3<f64>; 4] {
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

impl World {
    /// Nearest facet along a ray; `None` when it leaves the scene. O(facets).
    pub fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        nearest(&self.facets, 0..self.facets.len(), origin, direction)
    }

    /// The facets, in the order hits refer to.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// Nearest facet along a ray through a pixel, from the candidates of its cell.
    pub(super) fn cast_indexed(
        &self,
        candidates: &[u32],
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<Hit> {
        nearest(
            &self.facets,
            candidates.iter().map(|&k| k as usize),
            origin,
            direction,
        )
    }

    /// Sorts the facets into the screen cells of a camera.
    pub(super) fn screen_index(&self, world_from_camera: &Isometry3<f64>) -> ScreenIndex {
        let camera_from_world = world_from_camera.inverse();
        let mut cells = vec![Vec::new(); CELL_COLUMNS * CELL_ROWS];
        for (index, facet) in self.facets.iter().enumerate() {
            let eye = world_from_camera.translation.vector[facet.axis];
            if (eye - facet.offset) * facet.normal_sign <= 0.0 {
                continue;
            }
            let corners = facet.corners().map(|corner| camera_from_world * corner);
            let Some([c0, r0, c1, r1]) = cell_range(&corners) else {
                continue;
            };
            for row in r0..=r1 {
                for column in c0..=c1 {
                    cells[row * CELL_COLUMNS + column].push(index as u32);
                }
            }
        }
        ScreenIndex { cells }
    }
}

impl ScreenIndex {
    /// Candidates for a pixel.
    pub(super) fn at(&self, column: usize, row: usize) -> &[u32] {
        &self.cells[(row / CELL_PX) * CELL_COLUMNS + column / CELL_PX]
    }
}

fn nearest(
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

/// First and last cell columns and rows that a facet with these corners (camera
/// axes) can touch; `None` when it is off screen or behind the camera.
fn cell_range(corners: &[Point3<f64>; 4]) -> Option<[usize; 4]> {
    let in_front = corners.iter().filter(|c| c.z > NEAR_M).count();
    if in_front == 0 {
        return None;
    }
    if in_front < 4 {
        return Some([0, 0, CELL_COLUMNS - 1, CELL_ROWS - 1]);
    }
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for pixel in corners.iter().filter_map(project) {
        for k in 0..2 {
            low[k] = low[k].min(pixel[k]);
            high[k] = high[k].max(pixel[k]);
        }
    }
    let size = [WIDTH as f64, HEIGHT as f64];
    if (0..2).any(|k| high[k] < -1.0 || low[k] > size[k]) {
        return None;
    }
    // One pixel of room for samples beside the pixel centres.
    let cell = |value: f64, last: usize| (value.max(0.0) as usize / CELL_PX).min(last);
    Some([
        cell(low[0] - 1.0, CELL_COLUMNS - 1),
        cell(low[1] - 1.0, CELL_ROWS - 1),
        cell(high[0] + 1.0, CELL_COLUMNS - 1),
        cell(high[1] + 1.0, CELL_ROWS - 1),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::ray;
    use crate::scene::{Scene, SceneSpec};

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

    #[test]
    fn screen_index_misses_no_facet() {
        for spec in [SceneSpec::wall(3), SceneSpec::room(3)] {
            let scene = Scene::new(spec).unwrap();
            for frame in [0, 17, 25] {
                let pose = scene.world_from_camera(frame);
                let index = scene.world().screen_index(&pose);
                let eye = Point3::from(pose.translation.vector);
                for k in 0..2000 {
                    let (column, row) = (k * 7919 % WIDTH, k * 104_729 % HEIGHT);
                    let direction = pose * ray(column as f64 + 0.37, row as f64 - 0.44);
                    let fast = scene
                        .world()
                        .cast_indexed(index.at(column, row), &eye, &direction);
                    assert_eq!(fast, scene.world().cast(&eye, &direction));
                }
            }
        }
    }
}
