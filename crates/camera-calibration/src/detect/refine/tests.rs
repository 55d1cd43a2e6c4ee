//! The fit against corners whose truth is known.

use super::*;

fn state() -> SVector<f64, N> {
    SVector::from([
        12.3,
        11.6,
        0.3,
        1.7,
        0.9_f64.ln(),
        1.3_f64.ln(),
        55.0,
        120.0,
        0.4,
        -0.3,
    ])
}

fn plane(state: &SVector<f64, N>) -> Plane {
    Plane {
        width: 25,
        height: 24,
        values: (0..25 * 24)
            .map(|k| {
                model(
                    state,
                    &Edge::both(state, BENDS),
                    &[f64::from(k % 25), f64::from(k / 25), 0.0],
                )
                .0 as f32
            })
            .collect(),
    }
}

const BENDS: [f64; 2] = [0.004, -0.002];

fn near(position: [f64; 2], directions: [f64; 2], width: f64) -> Shape {
    Shape {
        position,
        directions,
        bends: BENDS,
        width,
    }
}

fn wide() -> Window {
    Window::new([38.0, 6.0], [-5.0, 40.0]).unwrap()
}

#[test]
fn the_window_follows_the_squares() {
    let slanted = Window::new([20.0, 0.0], [4.0, 8.0]).unwrap();
    // 0.39 of either side is inside, 0.41 is not; the disc of 6 px cuts the long one.
    assert!(slanted.holds(0.39 * 4.0, 0.39 * 8.0) && !slanted.holds(0.41 * 4.0, 0.41 * 8.0));
    assert!(slanted.holds(5.9, 0.0) && !slanted.holds(6.1, 0.0));
    assert!(slanted.narrowest() > 2.5 && slanted.narrowest() < 3.3);
    assert!(Window::new([3.0, 1.0], [6.0, 2.0]).is_none());
}

#[test]
fn derivatives_agree_with_differences() {
    let truth = state();
    for pixel in [[10.0, 12.0, 0.0], [15.0, 9.0, 0.0], [12.0, 11.0, 0.0]] {
        let (_, row) = model(&truth, &Edge::both(&truth, BENDS), &pixel);
        for k in 0..N {
            let step = 1e-5;
            let mut moved = [truth, truth];
            moved[0][k] -= step;
            moved[1][k] += step;
            let difference = (model(&moved[1], &Edge::both(&moved[1], BENDS), &pixel).0
                - model(&moved[0], &Edge::both(&moved[0], BENDS), &pixel).0)
                / (2.0 * step);
            // Truncation h^2 f''' / 6 and rounding of levels near 200 over 2e-5 both stay below this.
            assert!(
                (row[k] - difference).abs() < 1e-6 * row[k].abs().max(10.0),
                "{k}: {} {difference}",
                row[k]
            );
        }
    }
}

#[test]
fn an_image_of_the_model_gives_its_parameters_back() {
    let truth = state();
    let found = fit(
        &plane(&truth),
        &near([13.1, 11.0], [0.2, 1.85], 1.0),
        &wide(),
        Freedom::Full,
    )
    .unwrap();
    assert!((found.position[0] - 12.3).abs() < 1e-4, "{found:?}");
    assert!((found.position[1] - 11.6).abs() < 1e-4);
    assert!((found.directions[1] - 1.7).abs() < 1e-3);
    assert!((found.widths[0] - 0.9).abs() < 1e-3 && (found.widths[1] - 1.3).abs() < 1e-3);
    assert!(found.sigma_px < 1e-4);
}

#[test]
fn a_stiff_fit_finds_the_place_in_a_small_window() {
    let mut truth = state();
    (truth[4], truth[5], truth[8], truth[9]) = (1.1_f64.ln(), 1.1_f64.ln(), 0.0, 0.0);
    let small = Window::new([16.0, 5.0], [-2.0, 7.5]).unwrap();
    let place = near([12.7, 11.3], [0.2, 1.85], 1.1);
    let found = fit(&plane(&truth), &place, &small, Freedom::Stiff).unwrap();
    assert!((found.position[0] - 12.3).abs() < 1e-4, "{found:?}");
    assert!((found.position[1] - 11.6).abs() < 1e-4);
    assert!((found.widths[0] - 1.1).abs() < 1e-12);
}

#[test]
fn a_flat_window_has_no_contrast_and_a_cropped_one_no_corner() {
    let mut flat = plane(&state());
    flat.values.fill(80.0);
    assert!(
        fit(
            &flat,
            &near([12.0, 12.0], [0.2, 1.8], 1.0),
            &wide(),
            Freedom::Full
        )
        .is_none_or(|found| found.contrast < 1e-6)
    );
    assert!(
        fit(
            &plane(&state()),
            &near([0.5, 0.5], [0.2, 1.8], 1.0),
            &wide(),
            Freedom::Full
        )
        .is_none()
    );
}
