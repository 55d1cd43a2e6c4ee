//! Doubts of a calibration in words a photographer can act on.

use mono_geometry::calibration::CalibrationWarning;

use crate::calibrate::CalibrationRun;
use crate::report::units::three_digits;

/// One sentence: what was measured, what it means, what to do.
pub fn plain_warning(run: &CalibrationRun, warning: &CalibrationWarning) -> String {
    let boards: Vec<String> = run
        .images
        .iter()
        .filter(|image| image.board.is_some())
        .map(|image| image.name())
        .collect();
    let name = |view: usize| boards.get(view).map_or("?", String::as_str);
    match warning {
        CalibrationWarning::ViewSkipped { view, reason } => {
            format!("{} was left out: {reason}", name(*view))
        }
        CalibrationWarning::NotConverged { .. } => {
            "the refinement did not reach a minimum: do not use this calibration".into()
        }
        CalibrationWarning::WeakParameter {
            name, value, sigma, ..
        } if sigma.is_finite() => format!(
            "{name} = {} is known to {} only: more images, tilted more and out to the corners of the picture, would help",
            figure(*value),
            figure(*sigma)
        ),
        CalibrationWarning::WeakParameter { name, .. } => {
            format!("the images do not fix {name}: tilt the board, at different distances")
        }
        CalibrationWarning::WeakCombination {
            terms,
            sigmas_over_limit,
        } => {
            let names: Vec<&str> = terms.iter().map(|term| term.0).collect();
            format!(
                "the images hardly fix {} together ({} times the uncertainty allowed): tilt the board more, or choose a simpler lens model",
                names.join(", "),
                if sigmas_over_limit.is_finite() {
                    three_digits(*sigmas_over_limit)
                } else {
                    "infinitely many".into()
                }
            )
        }
        CalibrationWarning::Correlated {
            first,
            second,
            correlation,
            ..
        } => format!(
            "{first} and {second} can hardly be told apart (correlation {correlation:.3}): their sum of effects is known, each alone is not"
        ),
        CalibrationWarning::ViewsNearlyParallel {
            largest_angle_rad, ..
        } => format!(
            "the board was turned by {:.1}° at most between any two images: tilt it by 30° and more, in several directions",
            largest_angle_rad.to_degrees()
        ),
        CalibrationWarning::DistortionExtrapolated {
            corner_radius_px,
            image_radius_px,
            ..
        } => format!(
            "no corner lies further than {corner_radius_px:.0} px from the centre, the picture reaches {image_radius_px:.0} px: beyond, the lens is a guess"
        ),
        CalibrationWarning::ViewResidual {
            view,
            rms_px,
            median_rms_px,
            ..
        } => format!(
            "{} fits badly: {rms_px:.2} px, the middle view {median_rms_px:.2} px. Motion blur, or another board?",
            name(*view)
        ),
    }
}

/// A number with four significant digits.
pub(super) fn figure(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0" } else { "unknown" }.into();
    }
    let decimals = (3.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

/// A value to the second digit of its standard deviation, and that deviation.
pub(super) fn with_sigma(value: f64, sigma: f64) -> (String, String) {
    if !(sigma.is_finite() && sigma > 0.0) {
        return (figure(value), "not fixed".into());
    }
    let decimals = (1.0 - sigma.log10().floor()).clamp(0.0, 9.0) as usize;
    (
        format!("{value:.decimals$}").replace('-', "\u{2212}"),
        format!("{sigma:.decimals$}"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_digits_that_are_known() {
        let (value, sigma) = with_sigma(420.506_712, 0.1234);
        assert_eq!((value.as_str(), sigma.as_str()), ("420.51", "0.12"));
        let (value, sigma) = with_sigma(-0.296_681, 0.000_456);
        assert_eq!(
            (value.as_str(), sigma.as_str()),
            ("\u{2212}0.29668", "0.00046")
        );
        assert_eq!(with_sigma(1.0, f64::INFINITY).1, "not fixed");
        assert_eq!(figure(0.012_345), "0.01235");
        assert_eq!(figure(420.5), "420.5");
    }
}
