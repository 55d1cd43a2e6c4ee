//! The warnings of a calibration in words that a photographer can act on.

use mono_geometry::calibration::CalibrationWarning;

use crate::images::CalibrationRun;

/// Largest standard deviation of a focal length, as a share of it, that leaves a calibration usable: directions at the
/// edge of a view of 60 degrees are then wrong by 1.6 degrees.
const USABLE_FOCAL_SIGMA: f64 = 0.05;
/// Largest standard deviation of the principal point, as a share of the side.
const USABLE_CENTRE_SIGMA: f64 = 0.05;

impl CalibrationRun {
    /// Why this calibration should not be used at all, in one sentence; `None` where it can be.
    ///
    /// That is a refinement without a minimum, or a focal length or principal point known to a twentieth only, as from
    /// images that all show the board in one pose.
    pub fn unusable(&self) -> Option<String> {
        let calibration = &self.calibration;
        if calibration
            .warnings
            .iter()
            .any(|warning| matches!(warning, CalibrationWarning::NotConverged { .. }))
        {
            return Some("the refinement did not reach a minimum".into());
        }
        for parameter in &calibration.parameters {
            let (limit, unit) = match parameter.name {
                "fx" | "fy" => (USABLE_FOCAL_SIGMA * parameter.value, "of it"),
                "cx" => (USABLE_CENTRE_SIGMA * self.width as f64, "of the width"),
                "cy" => (USABLE_CENTRE_SIGMA * self.height as f64, "of the height"),
                _ => continue,
            };
            // Written so that an infinite or undefined deviation is too large.
            let known = parameter.sigma <= limit;
            if !known {
                return Some(format!(
                    "{} = {} px is known to {} px only, more than {:.0} % {unit}: take images with the board tilted in several \
                     directions and out to the corners of the picture",
                    parameter.name,
                    significant(parameter.value),
                    significant(parameter.sigma),
                    100.0 * USABLE_FOCAL_SIGMA
                ));
            }
        }
        None
    }

    /// Each warning of the calibration in one sentence: what was measured, what it means, what to do.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let boards: Vec<&str> = self
            .images
            .iter()
            .filter(|image| image.board.is_some())
            .map(|image| image.name.as_str())
            .collect();
        let warnings = self.calibration.warnings.iter();
        warnings.map(move |warning| sentence(warning, &boards))
    }
}

/// A number with four significant digits and a true minus sign.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0" } else { "unknown" }.into();
    }
    let decimals = (3.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

/// The warning in words; `boards` are the names of the images behind the views that were given.
fn sentence(warning: &CalibrationWarning, boards: &[&str]) -> String {
    let name = |view: usize| boards.get(view).copied().unwrap_or("?");
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
            significant(*value),
            significant(*sigma)
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
                times(*sigmas_over_limit)
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
        other => other.to_string(),
    }
}

/// The ratio of a combination that is known too badly, with three significant digits.
fn times(ratio: f64) -> String {
    if !ratio.is_finite() {
        return "infinitely many".into();
    }
    let decimals = match ratio {
        _ if ratio >= 99.95 => 0,
        _ if ratio >= 9.995 => 1,
        _ => 2,
    };
    format!("{ratio:.decimals$}")
}

#[cfg(test)]
mod tests {
    use mono_geometry::calibration::SkipReason;

    use super::*;

    #[test]
    fn values_have_four_significant_digits() {
        assert_eq!(significant(0.012_345), "0.01235");
        assert_eq!(significant(420.5), "420.5");
        assert_eq!(significant(-3.0), "\u{2212}3.000");
        assert_eq!(times(123.4), "123");
        assert_eq!(times(1.234), "1.23");
        assert_eq!(times(f64::INFINITY), "infinitely many");
    }

    #[test]
    fn a_warning_names_the_image_behind_its_view() {
        let warning = CalibrationWarning::ViewSkipped {
            view: 1,
            reason: SkipReason::NotVisible { corners: 3 },
        };
        let sentence = sentence(&warning, &["a.png", "b.png"]);
        assert!(sentence.starts_with("b.png was left out: "), "{sentence}");
    }
}
