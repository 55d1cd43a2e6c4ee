//! The observations of one frame: measurements with the ids of their landmarks, or without.

use crate::error::RangeBearingError;
use nalgebra::SVector;

/// A frame with known association: the control since the last one, and measurements of named landmarks.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame<C, const M: usize> {
    /// The control u.
    pub control: C,
    /// Landmark ids, each at most once, with their measurements.
    pub measurements: Vec<(u32, SVector<f64, M>)>,
}

/// A frame with unknown association: the control since the last one, and measurements without ids.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan<C, const M: usize> {
    /// The control u.
    pub control: C,
    /// The measurements.
    pub measurements: Vec<SVector<f64, M>>,
}

impl<C, const M: usize> Frame<C, M> {
    /// Refuses an id that occurs twice and a measurement that is not finite. O(n), O(n log n) for ids
    /// out of order.
    pub(crate) fn check(&self) -> Result<(), RangeBearingError> {
        if !self.measurements.is_sorted_by_key(|(id, _)| *id)
            || self
                .measurements
                .windows(2)
                .any(|pair| pair[0].0 == pair[1].0)
        {
            let mut ids: Vec<u32> = self.measurements.iter().map(|(id, _)| *id).collect();
            ids.sort_unstable();
            if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
                let times = ids.iter().filter(|id| **id == pair[0]).count();
                return Err(RangeBearingError::DuplicateId { id: pair[0], times });
            }
        }
        self.measurements
            .iter()
            .try_for_each(|(id, measured)| check_measurement(*id, measured))
    }
}

/// Refuses a measurement that is not finite; `id` names it in the error.
pub(crate) fn check_measurement<const M: usize>(
    id: u32,
    measured: &SVector<f64, M>,
) -> Result<(), RangeBearingError> {
    match measured.iter().enumerate().find(|(_, z)| !z.is_finite()) {
        Some((entry, &value)) => Err(RangeBearingError::MeasurementNotFinite { id, entry, value }),
        None => Ok(()),
    }
}
