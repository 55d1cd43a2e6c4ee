//! From paints to finished skins, each from a random stream of its own.
//!
//! Every skin is multiplied by the light of the room, which is smooth over metres.

use super::canvas::Skin8;
use super::draw::Noise;
use super::kind::Skin;
use super::wall_plan::WallPlan;
use crate::facet::Facet;
use crate::stream::{Purpose, stream};
use nalgebra::Point3;
use rayon::prelude::*;

/// The paint of one rectangle.
#[derive(Debug, Clone)]
pub(crate) enum Paint {
    /// One skin under a constant share of the light.
    Skin { skin: Skin, light: f64 },
    /// A skin of which every place has the same copy.
    Twin(Skin),
    /// A whole wall.
    Wall(WallPlan),
}

/// The finished skins of a scene, one a facet. Only images need them.
#[derive(Debug, Clone)]
pub struct Skins {
    finished: Vec<Skin8>,
}

impl Skins {
    /// Brightness (0..255) of a facet at a point on it.
    pub(crate) fn brightness(&self, facets: &[Facet], facet: usize, point: &Point3<f64>) -> f32 {
        let (x, y) = facets[facet].skin_position(point);
        self.finished[facet].sample(x, y)
    }
}

/// Paints every facet. Parallel over facets; facet k uses stream k only (twins share one), so
/// the number of threads changes nothing.
pub(crate) fn paint_facets(facets: &[Facet], paints: &[Paint], seed: u64) -> Skins {
    let light = Noise::new(&mut stream(seed, Purpose::Light, 0));
    let finished = facets
        .par_iter()
        .zip(paints)
        .enumerate()
        .map(|(index, (facet, paint))| {
            let mut rng = match paint {
                Paint::Twin(_) => stream(seed, Purpose::Poster, 0),
                Paint::Skin { .. } | Paint::Wall(_) => stream(seed, Purpose::Skin, index as u64),
            };
            let (width, height) = facet.size();
            let (mut canvas, share) = match paint {
                Paint::Skin { skin, light } => (skin.canvas(width, height, &mut rng), *light),
                Paint::Twin(skin) => (skin.canvas(width, height, &mut rng), 1.0),
                Paint::Wall(plan) => (plan.canvas(width, height, &mut rng), 1.0),
            };
            canvas.shade(|x, y| {
                let p = facet.skin_point(x, y);
                let smooth = light.at(0.7 * p.x + 0.3 * p.z, 0.7 * p.y + 0.5 * p.z);
                share * (0.84 + 0.13 * smooth + 0.05 * (p.z - 1.0))
            });
            canvas.finish()
        })
        .collect();
    Skins { finished }
}
