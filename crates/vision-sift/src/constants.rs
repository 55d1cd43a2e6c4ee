//! Every constant of the method, named, with its place in the paper.
//!
//! Source: D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004, called *Lowe*
//! below. Where this crate departs from the paper the constant says so. Grey values are scaled to `[0, 1]`.

/// Shortest image side accepted, pixels. Below it no octave has room for an extremum away from the border.
pub(crate) const MIN_IMAGE_SIDE: usize = 16;

/// Longest image side accepted, pixels. At this length a doubled image still has exact `f32` coordinates.
pub(crate) const MAX_IMAGE_SIDE: usize = 32_767;

/// Extrema nearer than this to the border of their octave are not searched for, octave pixels. Implementation choice
/// (the descriptor window of such points is mostly outside); OpenCV uses the same value.
pub(crate) const BORDER: usize = 5;

/// A kernel reaches this many standard deviations each way, rounded to samples. Implementation choice: OpenCV's 4 make the
/// pyramid a third slower and raise repeatability by 0.002.
pub(crate) const KERNEL_REACH_SIGMAS: f32 = 3.0;

/// Extrema below this share of the contrast threshold are dropped before the refinement: the refined value
/// `D + D'x/2` exceeds the sample by too little to pass. Implementation choice.
pub(crate) const PREFILTER_SHARE: f32 = 0.8;

/// Steps of the refinement before a point is given up. Lowe, section 4, gives no number; 5 is customary.
pub(crate) const MAX_REFINE_STEPS: usize = 5;

/// A refined offset is accepted up to this length per axis, samples. Lowe, section 4, says 0.5; the hysteresis of 0.1
/// keeps points that would hop between two samples and measurably raises repeatability.
pub(crate) const MAX_REFINE_OFFSET: f32 = 0.6;

/// A fit that cannot move on is kept up to this offset per axis, samples; OpenCV rejects it. Implementation choice: at 1
/// it raises repeatability by 0.004 and the number of keypoints by 3 %; at 1.5 the positions suffer.
pub(crate) const MAX_LAST_OFFSET: f32 = 1.0;

/// Orientation histogram: number of bins over the full circle. Lowe, section 5: 36.
pub(crate) const ORIENTATION_BINS: usize = 36;

/// Orientation histogram: standard deviation of the window in units of the keypoint scale. Lowe, section 5: 1.5.
pub(crate) const ORIENTATION_SIGMA_FACTOR: f32 = 1.5;

/// Orientation histogram: the window reaches this many of its standard deviations. Implementation choice: 3.
pub(crate) const ORIENTATION_REACH_SIGMAS: f32 = 3.0;

/// A secondary peak at least this share of the highest makes a keypoint of its own. Lowe, section 5: 0.8.
pub(crate) const ORIENTATION_PEAK_RATIO: f32 = 0.8;

/// Descriptor: spatial cells per side. Lowe, section 6.2: 4.
pub(crate) const DESCRIPTOR_CELLS: usize = 4;

/// Descriptor: orientation bins per cell. Lowe, section 6.2: 8.
pub(crate) const DESCRIPTOR_BINS: usize = 8;

/// Length of a descriptor: 4 x 4 cells x 8 bins.
pub(crate) const DESCRIPTOR_LENGTH: usize = DESCRIPTOR_CELLS * DESCRIPTOR_CELLS * DESCRIPTOR_BINS;

/// Descriptor: side of a cell in units of the keypoint scale. Lowe gives 4 samples a cell at one scale; 3 sigma is what
/// his program and OpenCV use.
pub(crate) const DESCRIPTOR_CELL_SIGMAS: f32 = 3.0;

/// Descriptor: standard deviation of the window in cells; half the window width of 4 cells. Lowe, section 6.1.
pub(crate) const DESCRIPTOR_WINDOW_SIGMA_CELLS: f32 = 2.0;

/// Descriptor: values of the unit vector above this are cut before renormalising. Lowe, section 6.1: 0.2.
pub(crate) const DESCRIPTOR_CLIP: f32 = 0.2;

/// Descriptor: unit vector to bytes, values above 255 saturate. As OpenCV.
pub(crate) const DESCRIPTOR_BYTE_SCALE: f32 = 512.0;

/// Columns of the widest window over all parameters: a descriptor at scale 12.1 (`base_sigma` 4, one scale an octave,
/// refined 0.6 levels up), turned by 45 degrees, reaches `2.5 * 3 * 12.1 * sqrt(2) = 129` samples each way.
pub(crate) const MAX_WINDOW_COLUMNS: usize = 272;

/// An odd polynomial of the arctangent on `[0, 1]`: the coefficients of `q, q^3, ... q^11`.
pub(crate) type Arctangent = [f32; 6];

/// The polynomial of this crate, a minimax fit: over the circle it errs by less than 2.5e-6 radians.
pub(crate) const ARCTANGENT: Arctangent = [
    0.999_977_23,
    -0.332_622_83,
    0.193_540_35,
    -0.116_426_39,
    0.052_647_255,
    -0.011_719_096,
];

/// The polynomial of OpenCV's `fastAtan2`, which errs by up to 1.7e-4 radians.
pub(crate) const OPENCV_ARCTANGENT: Arctangent = [
    0.999_787_84,
    -0.325_808_4,
    0.155_578_65,
    -0.044_326_555,
    0.0,
    0.0,
];
