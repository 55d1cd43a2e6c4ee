//! A screen grid over the facets, which leaves a handful of candidates for the ray of a pixel.
//!
//! Each facet is projected into the image and listed in the cells that it can touch.

use crate::camera::{HEIGHT, Lens, WIDTH};
use crate::facet::Facet;
use nalgebra::{Isometry3, Point3, Vector3};

/// Pixels along the edge of a screen cell.
const CELL_PX: usize = 16;
const CELL_COLUMNS: usize = WIDTH.div_ceil(CELL_PX);
const CELL_ROWS: usize = HEIGHT.div_ceil(CELL_PX);
/// Corners nearer than this (metres) cannot be projected safely.
const NEAR_M: f64 = 0.05;

/// Facets that may be seen in each cell of the screen.
#[derive(Debug, Clone)]
pub(crate) struct ScreenIndex {
    cells: Vec<Vec<u32>>,
}

impl ScreenIndex {
    /// Sorts the facets into the screen cells of a camera.
    pub(crate) fn new(facets: &[Facet], world_from_camera: &Isometry3<f64>, lens: Lens) -> Self {
        let camera_from_world = world_from_camera.inverse();
        let cones = match lens {
            Lens::Pinhole => Vec::new(),
            Lens::Equidistant(_) => (0..CELL_COLUMNS * CELL_ROWS)
                .map(|cell| Cone::of_cell(cell, lens))
                .collect(),
        };
        let mut cells = vec![Vec::new(); CELL_COLUMNS * CELL_ROWS];
        for (index, facet) in facets.iter().enumerate() {
            let eye = world_from_camera.translation.vector[facet.axis];
            if (eye - facet.offset) * facet.normal_sign <= 0.0 {
                continue;
            }
            let corners = facet.corners().map(|corner| camera_from_world * corner);
            if lens != Lens::Pinhole {
                for (cell, cone) in cells.iter_mut().zip(&cones) {
                    if cone.may_see(&corners) {
                        cell.push(index as u32);
                    }
                }
                continue;
            }
            let Some([c0, r0, c1, r1]) = cell_range(&corners) else {
                continue;
            };
            for row in r0..=r1 {
                for column in c0..=c1 {
                    cells[row * CELL_COLUMNS + column].push(index as u32);
                }
            }
        }
        Self { cells }
    }

    /// Candidates for a pixel, in ascending order.
    pub(crate) fn at(&self, column: usize, row: usize) -> &[u32] {
        &self.cells[(row / CELL_PX) * CELL_COLUMNS + column / CELL_PX]
    }
}

/// A cone about all rays of a cell: straight edges are bent in the picture, but not on the sphere.
struct Cone {
    axis: Vector3<f64>,
    half_angle: f64,
}

impl Cone {
    fn of_cell(cell: usize, lens: Lens) -> Self {
        let (column, row) = (cell % CELL_COLUMNS, cell / CELL_COLUMNS);
        let ray = |i: f64, j: f64| {
            let at = |cell: usize, share: f64| (cell as f64 + share) * CELL_PX as f64 - 0.5;
            lens.ray(at(column, i), at(row, j)).normalize()
        };
        let axis = ray(0.5, 0.5);
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let farthest = corners.map(|(i, j)| ray(i, j).angle(&axis));
        Self {
            axis,
            // Room for samples beside the pixel centres.
            half_angle: farthest.iter().copied().fold(0.0, f64::max) * 1.1,
        }
    }

    /// Whether the ball about a facet reaches into the cone.
    fn may_see(&self, corners: &[Point3<f64>; 4]) -> bool {
        let centre = corners.iter().map(|c| c.coords).sum::<Vector3<f64>>() / 4.0;
        let radius = (corners[0].coords - centre).norm();
        let ratio = radius / centre.norm();
        ratio >= 1.0 || centre.angle(&self.axis) <= self.half_angle + ratio.asin()
    }
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
    for pixel in corners.iter().filter_map(|c| Lens::Pinhole.project(c)) {
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
