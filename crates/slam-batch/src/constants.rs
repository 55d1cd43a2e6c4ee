//! The constants of a robot that a batch can learn: what is the same at every instant of a drive.

use core::ops::{Index, IndexMut};

/// A constant of the carrier or of the calibration.
///
/// The values are deviations from what the rig and the odometry say, so zero is nominal for all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Constant {
    /// Metres driven for each metre that the wheels tell, less one.
    WheelScale,
    /// Distance from the body origin forward to the point that does not move sideways, metres.
    TurningCentre,
    /// Angle from body x to the direction of straight travel, radians.
    SlipAngle,
    /// Added to every turn rate of the odometry, rad/s.
    TurnRateBias,
    /// Turn of the camera about body z beyond the mount of the rig, radians.
    MountYaw,
    /// Position of the camera in the body beyond the mount of the rig, forward, metres.
    LeverX,
    /// Position of the camera in the body beyond the mount of the rig, to the left, metres.
    LeverY,
    /// True focal lengths over those of the rig, less one.
    FocalScale,
    /// True principal point less that of the rig, x, pixels.
    PrincipalX,
    /// True principal point less that of the rig, y, pixels.
    PrincipalY,
    /// True first lens coefficient (k1) less that of the rig.
    Lens,
}

impl Constant {
    /// Number of constants.
    pub const COUNT: usize = 11;
    /// All constants, in their order.
    pub const ALL: [Self; Self::COUNT] = [
        Self::WheelScale,
        Self::TurningCentre,
        Self::SlipAngle,
        Self::TurnRateBias,
        Self::MountYaw,
        Self::LeverX,
        Self::LeverY,
        Self::FocalScale,
        Self::PrincipalX,
        Self::PrincipalY,
        Self::Lens,
    ];
    /// Constants before this index act on the odometry, the others on the pixels.
    pub(crate) const OF_MOTION: usize = 7;

    /// Name with unit, as in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WheelScale => "wheel_scale",
            Self::TurningCentre => "turning_centre_m",
            Self::SlipAngle => "slip_angle_rad",
            Self::TurnRateBias => "turn_rate_bias_radps",
            Self::MountYaw => "mount_yaw_rad",
            Self::LeverX => "lever_x_m",
            Self::LeverY => "lever_y_m",
            Self::FocalScale => "focal_scale",
            Self::PrincipalX => "cx_px",
            Self::PrincipalY => "cy_px",
            Self::Lens => "k1",
        }
    }
}

/// One number for each constant: values, or standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Constants([f64; Constant::COUNT]);

impl Constants {
    /// All zero: the nominal robot, or everything known exactly.
    pub const ZERO: Self = Self([0.0; Constant::COUNT]);

    /// The same with another value for one constant.
    #[must_use]
    pub fn with(mut self, constant: Constant, value: f64) -> Self {
        self[constant] = value;
        self
    }

    /// Constants with their numbers, in order.
    pub fn iter(&self) -> impl Iterator<Item = (Constant, f64)> {
        Constant::ALL.into_iter().zip(self.0)
    }
}

impl Index<Constant> for Constants {
    type Output = f64;
    fn index(&self, constant: Constant) -> &f64 {
        &self.0[constant as usize]
    }
}

impl IndexMut<Constant> for Constants {
    fn index_mut(&mut self, constant: Constant) -> &mut f64 {
        &mut self.0[constant as usize]
    }
}
