//! A grey raster one paints on in metres: the skin of one rectangle of the scene.
//!
//! Origin top left, x to the viewer's right, y down, both in metres; a texel is
//! [`TEXEL_M`] wide, about 0.4 of an image pixel at 2 m, so that the renderer's
//! supersampling sees every painted edge. Painting is by shape: each texel
//! centre inside the bounds asks a closure for its tone. Tones are reflectances
//! in 0..1; 8 bits are kept, because sensor noise is added afterwards.

/// Edge of a texel in metres.
pub(crate) const TEXEL_M: f64 = 0.002;

/// A grey picture with a metric size.
#[derive(Debug, Clone)]
pub(crate) struct Canvas {
    pub(crate) width_m: f64,
    pub(crate) height_m: f64,
    columns: usize,
    rows: usize,
    tones: Vec<f32>,
}

/// The finished skin: 8 bits a texel, sampled bilinearly.
#[derive(Debug, Clone)]
pub(crate) struct Skin8 {
    columns: usize,
    rows: usize,
    tones: Vec<u8>,
}

impl Canvas {
    /// A canvas of one tone. Sizes are raised to at least one texel.
    pub(crate) fn new(width_m: f64, height_m: f64, tone: f64) -> Self {
        let columns = (width_m / TEXEL_M).ceil().max(1.0) as usize;
        let rows = (height_m / TEXEL_M).ceil().max(1.0) as usize;
        Self {
            width_m,
            height_m,
            columns,
            rows,
            tones: vec![tone as f32; columns * rows],
        }
    }

    /// The whole canvas as a rectangle: left, top, right, bottom, metres.
    pub(crate) fn bounds(&self) -> [f64; 4] {
        [0.0, 0.0, self.width_m, self.height_m]
    }

    /// Paints every texel centre of the rectangle for which `tone` answers.
    /// The closure gets the position and the present tone.
    pub(crate) fn paint(
        &mut self,
        [x0, y0, x1, y1]: [f64; 4],
        tone: impl Fn(f64, f64, f64) -> Option<f64>,
    ) {
        let (c0, c1) = texel_range(x0, x1, self.columns);
        let (r0, r1) = texel_range(y0, y1, self.rows);
        for row in r0..r1 {
            let y = (row as f64 + 0.5) * TEXEL_M;
            let line = &mut self.tones[row * self.columns..(row + 1) * self.columns];
            for column in c0..c1 {
                let x = (column as f64 + 0.5) * TEXEL_M;
                if let Some(value) = tone(x, y, f64::from(line[column])) {
                    line[column] = value as f32;
                }
            }
        }
    }

    /// Multiplies the whole canvas by a factor that varies with position.
    pub(crate) fn shade(&mut self, factor: impl Fn(f64, f64) -> f64) {
        self.paint(self.bounds(), |x, y, old| Some(old * factor(x, y)));
    }

    pub(crate) fn rect(&mut self, bounds: [f64; 4], tone: f64) {
        self.paint(bounds, |_, _, _| Some(tone));
    }

    pub(crate) fn disc(&mut self, x: f64, y: f64, radius: f64, tone: f64) {
        self.ring(x, y, 0.0, radius, tone);
    }

    pub(crate) fn ring(&mut self, x: f64, y: f64, inner: f64, outer: f64, tone: f64) {
        self.paint([x - outer, y - outer, x + outer, y + outer], |px, py, _| {
            let d2 = (px - x).powi(2) + (py - y).powi(2);
            (d2 <= outer * outer && d2 >= inner * inner).then_some(tone)
        });
    }

    /// A straight stroke with round ends.
    pub(crate) fn stroke(&mut self, a: [f64; 2], b: [f64; 2], thickness: f64, tone: f64) {
        let half = thickness / 2.0;
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length2 = dx * dx + dy * dy;
        let bounds = [
            a[0].min(b[0]) - half,
            a[1].min(b[1]) - half,
            a[0].max(b[0]) + half,
            a[1].max(b[1]) + half,
        ];
        self.paint(bounds, |x, y, _| {
            let along = if length2 > 0.0 {
                (((x - a[0]) * dx + (y - a[1]) * dy) / length2).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let d2 = (x - a[0] - along * dx).powi(2) + (y - a[1] - along * dy).powi(2);
            (d2 <= half * half).then_some(tone)
        });
    }

    /// A filled polygon, even-odd rule.
    pub(crate) fn polygon(&mut self, corners: &[[f64; 2]], tone: f64) {
        let mut bounds = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        for c in corners {
            bounds = [
                bounds[0].min(c[0]),
                bounds[1].min(c[1]),
                bounds[2].max(c[0]),
                bounds[3].max(c[1]),
            ];
        }
        self.paint(bounds, |x, y, _| {
            let mut inside = false;
            for (i, a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                if (a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0]
                {
                    inside = !inside;
                }
            }
            inside.then_some(tone)
        });
    }

    /// Lays another canvas on this one with its top-left corner at (x, y),
    /// turned by `angle` radians about its own centre.
    pub(crate) fn paste(&mut self, sheet: &Self, x: f64, y: f64, angle: f64) {
        let (half_w, half_h) = (sheet.width_m / 2.0, sheet.height_m / 2.0);
        let (centre_x, centre_y) = (x + half_w, y + half_h);
        let (sin, cos) = angle.sin_cos();
        let reach_x = half_w * cos.abs() + half_h * sin.abs();
        let reach_y = half_w * sin.abs() + half_h * cos.abs();
        self.paint(
            [
                centre_x - reach_x,
                centre_y - reach_y,
                centre_x + reach_x,
                centre_y + reach_y,
            ],
            |px, py, _| {
                let (dx, dy) = (px - centre_x, py - centre_y);
                let sheet_x = cos * dx + sin * dy + half_w;
                let sheet_y = -sin * dx + cos * dy + half_h;
                let inside = (0.0..sheet.width_m).contains(&sheet_x)
                    && (0.0..sheet.height_m).contains(&sheet_y);
                inside.then(|| sheet.tone_at(sheet_x, sheet_y))
            },
        );
    }

    fn tone_at(&self, x: f64, y: f64) -> f64 {
        let column = ((x / TEXEL_M) as usize).min(self.columns - 1);
        let row = ((y / TEXEL_M) as usize).min(self.rows - 1);
        f64::from(self.tones[row * self.columns + column])
    }

    /// The finished skin.
    pub(crate) fn finish(&self) -> Skin8 {
        Skin8 {
            columns: self.columns,
            rows: self.rows,
            tones: self
                .tones
                .iter()
                .map(|tone| (tone.clamp(0.0, 1.0) * 255.0).round() as u8)
                .collect(),
        }
    }
}

impl Skin8 {
    /// Bilinear tone at a position in metres, in 0..255; clamped at the rim.
    pub(crate) fn sample(&self, x: f64, y: f64) -> f32 {
        let fx = (x / TEXEL_M - 0.5).clamp(0.0, (self.columns - 1) as f64) as f32;
        let fy = (y / TEXEL_M - 0.5).clamp(0.0, (self.rows - 1) as f64) as f32;
        let (column, row) = (fx as usize, fy as usize);
        let (ax, ay) = (fx - column as f32, fy - row as f32);
        let right = (column + 1).min(self.columns - 1);
        let below = (row + 1).min(self.rows - 1);
        let at = |r: usize, c: usize| f32::from(self.tones[r * self.columns + c]);
        let top = at(row, column) + ax * (at(row, right) - at(row, column));
        let bottom = at(below, column) + ax * (at(below, right) - at(below, column));
        top + ay * (bottom - top)
    }
}

/// Texels whose centre lies in `[low, high)` metres, cut to the canvas.
fn texel_range(low: f64, high: f64, count: usize) -> (usize, usize) {
    let edge = |value: f64| (value / TEXEL_M - 0.5).ceil().clamp(0.0, count as f64) as usize;
    let (start, end) = (edge(low), edge(high));
    (start, end.max(start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangle_covers_its_area_and_no_more() {
        let mut canvas = Canvas::new(0.1, 0.06, 0.0);
        canvas.rect([0.02, 0.01, 0.06, 0.05], 1.0);
        let painted = canvas.tones.iter().filter(|tone| **tone > 0.5).count();
        assert_eq!(painted, 20 * 20);
    }

    #[test]
    fn disc_area_is_pi_r_squared() {
        let mut canvas = Canvas::new(0.4, 0.4, 0.0);
        canvas.disc(0.2, 0.2, 0.15, 1.0);
        let painted = canvas.tones.iter().filter(|tone| **tone > 0.5).count() as f64;
        let area = painted * TEXEL_M * TEXEL_M;
        let exact = std::f64::consts::PI * 0.15 * 0.15;
        assert!(
            (area - exact).abs() < 0.01 * exact,
            "{area} against {exact}"
        );
    }

    #[test]
    fn bilinear_sample_is_exact_on_a_ramp() {
        let mut canvas = Canvas::new(0.2, 0.1, 0.0);
        canvas.paint([0.0, 0.0, 0.2, 0.1], |x, _, _| Some(x / 0.2));
        let skin = canvas.finish();
        for x in [0.013, 0.05, 0.1004, 0.19] {
            let want = x / 0.2 * 255.0;
            assert!((f64::from(skin.sample(x, 0.05)) - want).abs() <= 0.51);
        }
    }

    #[test]
    fn a_turned_sheet_keeps_its_area() {
        let mut canvas = Canvas::new(0.5, 0.5, 0.0);
        canvas.paste(&Canvas::new(0.2, 0.1, 1.0), 0.15, 0.2, 0.3);
        let painted = canvas.tones.iter().filter(|tone| **tone > 0.5).count() as f64;
        assert!((painted * TEXEL_M * TEXEL_M - 0.02).abs() < 3e-4);
    }
}
