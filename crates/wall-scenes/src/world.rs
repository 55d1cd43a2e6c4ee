//! The geometry of a scene and the paint on it.

use crate::facet::Facet;
use crate::skin::paint::Paint;
use nalgebra::{Point3, Vector3};

/// Facets and the paints on them, index by index.
#[derive(Debug, Clone, Default)]
pub(crate) struct World {
    pub(crate) facets: Vec<Facet>,
    pub(crate) paints: Vec<Paint>,
}

impl World {
    /// A rectangle between two opposite corners, seen from the side `normal` points to.
    pub(crate) fn rectangle(
        &mut self,
        a: Point3<f64>,
        b: Point3<f64>,
        normal: Vector3<f64>,
        paint: Paint,
    ) {
        let axis = normal.iamax();
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        self.facets.push(Facet {
            axis,
            normal_sign: normal[axis].signum(),
            offset: a[axis],
            low: [a[first].min(b[first]), a[second].min(b[second])],
            high: [a[first].max(b[first]), a[second].max(b[second])],
        });
        self.paints.push(paint);
    }
}
