//! The kinds of skin a rectangle of the scene is painted with.
//!
//! Each skin fills a [`Canvas`] from a random stream of its own.

use super::canvas::Canvas;
use super::object::{carton, instrument, leaf, spine};
use super::sheet::{poster, sheet};
use super::surface::{wood, worn};
use rand_chacha::ChaCha8Rng;

/// How a rectangle is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Skin {
    /// One tone with stains and scratches.
    Worn { tone: f64 },
    /// Wood grain along x.
    Wood { tone: f64 },
    /// Spine of a book: bands and a title.
    Spine,
    /// Cardboard with a printed label and tape.
    Carton,
    /// Front of an instrument: knobs, displays, lettering.
    Instrument,
    /// Door leaf or cabinet front: panels, handle, notes.
    Leaf { tone: f64 },
    /// A sheet of paper or a picture.
    Sheet,
    /// Six sheets, two by three.
    Poster,
}

impl Skin {
    /// Paints a fresh canvas of this size.
    pub(crate) fn canvas(self, width_m: f64, height_m: f64, rng: &mut ChaCha8Rng) -> Canvas {
        let mut canvas = Canvas::new(width_m, height_m, 0.5);
        match self {
            Self::Worn { tone } => worn(&mut canvas, rng, tone),
            Self::Wood { tone } => wood(&mut canvas, rng, tone),
            Self::Spine => spine(&mut canvas, rng),
            Self::Carton => carton(&mut canvas, rng),
            Self::Instrument => instrument(&mut canvas, rng),
            Self::Leaf { tone } => leaf(&mut canvas, rng, tone),
            Self::Sheet => sheet(&mut canvas, rng),
            Self::Poster => poster(&mut canvas, rng),
        }
        canvas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_skin_paints_any_size_with_contrast() {
        let skins = [
            Skin::Worn { tone: 0.5 },
            Skin::Wood { tone: 0.5 },
            Skin::Spine,
            Skin::Carton,
            Skin::Instrument,
            Skin::Leaf { tone: 0.6 },
            Skin::Sheet,
            Skin::Poster,
        ];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for skin in skins {
            for (w, h) in [(0.5, 0.4), (0.02, 0.3), (0.3, 0.02)] {
                let done = skin.canvas(w, h, &mut rng).finish();
                let tones = (0..400).map(|k| {
                    done.sample(w * f64::from(k % 20) / 20.0, h * f64::from(k / 20) / 20.0)
                });
                let (low, high) =
                    tones.fold((255.0_f32, 0.0_f32), |(l, u), t| (l.min(t), u.max(t)));
                assert!(high > low, "{skin:?} {w} {h} is blank");
            }
        }
    }
}
