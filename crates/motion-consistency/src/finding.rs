//! The contradictions that can be found, with their numbers, as sentences.

use std::fmt;

/// How much better the matches fit a contradiction than what was stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Mean agreement of the matches with what was stated, 0 to 1, over the pairs that tell the two apart.
    pub stated: f64,
    /// The same with the contradiction.
    pub found: f64,
    /// Number of pairs of frames that tell the two apart.
    pub pairs: usize,
}

/// A contradiction between the odometry and the images.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// The images turn the other way.
    TurnSign(Support),
    /// The images turn `ratio` times as much as the odometry says.
    TurnRatio {
        /// Turn of the images over turn of the odometry.
        ratio: f64,
        /// Evidence.
        support: Support,
    },
    /// The camera travels backwards where the odometry says forwards.
    DrivingDirection(Support),
    /// The camera travels backwards and turns the other way.
    UpsideDown(Support),
    /// The camera travels in a direction turned about the vertical from what mount and odometry say.
    MountTurned {
        /// The turn from the stated to the found direction of travel, radians, left positive, seen by the camera.
        angle_rad: f64,
        /// Whether the images also turn the other way.
        mirrored: bool,
        /// Evidence.
        support: Support,
    },
    /// The camera is turned about its optical axis.
    MountRolled {
        /// The turn, radians, clockwise as seen from behind the camera.
        angle_rad: f64,
        /// Evidence.
        support: Support,
    },
    /// The images show far more parallax than the stated speeds can make.
    SpeedTooSmall(Support),
    /// The images turn in a way that is no multiple of the odometry's turns.
    TurnUnrelated {
        /// Root mean square turn of the images, radians a pair.
        images_rad: f64,
        /// Root mean square turn of the odometry, radians a pair.
        odometry_rad: f64,
        /// Evidence.
        support: Support,
    },
    /// The odometry stands still while the images move.
    OdometryAtRest {
        /// Pairs at rest in the odometry in which the image moves.
        moving: usize,
        /// Pairs at rest in the odometry.
        resting: usize,
        /// Median displacement in the image over the moving ones, pixels.
        displacement_px: f64,
    },
    /// The images stand still while the odometry moves.
    ImagesAtRest {
        /// Pairs whose image does not move though the odometry does.
        frozen: usize,
        /// Pairs in which the odometry moves.
        driven: usize,
        /// Distance driven in the frozen ones, metres.
        distance_m: f64,
        /// Absolute turns in the frozen ones, radians.
        turn_rad: f64,
    },
    /// The path that the images gave turns `ratio` times as much as the odometry.
    PathTurnRatio {
        /// Turn of the path over turn of the odometry.
        ratio: f64,
        /// Standard deviation of the ratio.
        sigma: f64,
        /// Sum of the absolute turns of the odometry, radians.
        turned_rad: f64,
    },
    /// The odometry's distances grow or shrink at once against those of the images.
    WheelSlip {
        /// Time of the jump, seconds.
        at_s: f64,
        /// Distance of the odometry over that of the images after the jump, compared with before.
        jump: f64,
    },
    /// The turns fit better when the odometry is taken from another time.
    ClockOffset {
        /// To be added to the times of the odometry, seconds.
        offset_s: f64,
        /// Mean difference of the turns of a pair as stated, radians.
        before_rad: f64,
        /// The same with the offset, radians.
        after_rad: f64,
        /// Number of pairs compared.
        pairs: usize,
    },
}

impl Finding {
    /// Stable name of the kind of contradiction.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::TurnSign(_) => "turn-sign",
            Self::TurnRatio { .. } => "turn-ratio",
            Self::DrivingDirection(_) => "driving-direction",
            Self::UpsideDown(_) => "camera-upside-down",
            Self::MountTurned { .. } => "mount-turned",
            Self::MountRolled { .. } => "mount-rolled",
            Self::SpeedTooSmall(_) => "speed-too-small",
            Self::TurnUnrelated { .. } => "turn-unrelated",
            Self::OdometryAtRest { .. } => "odometry-at-rest",
            Self::ImagesAtRest { .. } => "images-at-rest",
            Self::PathTurnRatio { .. } => "path-turn-ratio",
            Self::WheelSlip { .. } => "wheel-slip",
            Self::ClockOffset { .. } => "clock-offset",
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TurnSign(support) => write!(
                f,
                "The images turn the other way than the odometry ({support}): the turn rate should be positive to the left, \
                 or the camera is mounted upside down."
            ),
            Self::TurnRatio { ratio, support } => {
                write!(
                    f,
                    "The images turn about {} times as much as the odometry ({support}): ",
                    significant(*ratio)
                )?;
                let degrees = 1f64.to_radians();
                if (ratio / degrees - 1.0).abs() < 0.5 {
                    f.write_str("the turn rate seems to be in degrees per second.")
                } else if (ratio * degrees - 1.0).abs() < 0.5 {
                    f.write_str("the turn rate seems to have been converted to radians twice.")
                } else {
                    f.write_str("the turn rate, the distance between the wheels or the focal length is wrong.")
                }
            }
            Self::DrivingDirection(support) => write!(
                f,
                "The camera travels backwards where the odometry says forwards ({support}): the sign of the speed is wrong, \
                 or the camera looks the other way than its mount says."
            ),
            Self::UpsideDown(support) => write!(
                f,
                "The camera travels backwards and turns the other way than mount and odometry say ({support}): it is mounted \
                 upside down, or both signs are wrong."
            ),
            Self::MountTurned {
                angle_rad,
                mirrored,
                support,
            } => {
                let degrees = angle_rad.to_degrees();
                let side = if degrees > 0.0 { "left" } else { "right" };
                write!(
                    f,
                    "The camera travels {:.0} degrees further to its {side} than mount and odometry say{} ({support}): \
                     the mount of the camera is wrong or was left out (without one the camera looks forwards).",
                    degrees.abs(),
                    if *mirrored {
                        ", and the images turn the other way"
                    } else {
                        ""
                    },
                )
            }
            Self::MountRolled { angle_rad, support } => write!(
                f,
                "The images fit a camera turned by {:.0} degrees about its optical axis ({support}): \
                 the mount of the camera or the rotation of the images is wrong.",
                angle_rad.to_degrees()
            ),
            Self::SpeedTooSmall(support) => write!(
                f,
                "The image moves as if the robot drove some hundred times as fast as the odometry says ({support}): the speed \
                 seems to be in another unit than metres per second."
            ),
            Self::TurnUnrelated {
                images_rad,
                odometry_rad,
                support,
            } => write!(
                f,
                "The turns of the images have nothing to do with those of the odometry ({:.1} against {:.1} degrees from one \
                 compared frame to the next, {support}): the turn rate is missing, stuck, or from another drive.",
                images_rad.to_degrees(),
                odometry_rad.to_degrees()
            ),
            Self::OdometryAtRest {
                moving,
                resting,
                displacement_px,
            } => write!(
                f,
                "The odometry stands still while the image moves by {displacement_px:.0} pixels, in {moving} of {resting} \
                 compared spans without odometry: the wheels are not reported, or the robot was carried."
            ),
            Self::ImagesAtRest {
                frozen,
                driven,
                distance_m,
                turn_rad,
            } => write!(
                f,
                "The image stands still while the odometry drives {distance_m:.2} m and turns {:.0} degrees, in {frozen} of \
                 {driven} compared spans: the camera has stopped, or the wheels slip on the spot.",
                turn_rad.to_degrees()
            ),
            Self::PathTurnRatio {
                ratio,
                sigma,
                turned_rad,
            } => write!(
                f,
                "The path that the images give turns {ratio:.2} +- {sigma:.2} times as much as the odometry, which turns by {:.0} \
                 degrees in all: the distance between the wheels, the unit of the turn rate or the focal length is wrong.",
                turned_rad.to_degrees()
            ),
            Self::WheelSlip { at_s, jump } => {
                let (word, then) = if *jump > 1.0 {
                    ("From", "before")
                } else {
                    ("Up to", "after")
                };
                write!(
                    f,
                    "{word} {at_s:.2} s the odometry drives {:.1} times as far as {then}, for the same motion of the image: \
                     the wheels slip there, or speed or turn rate are wrong.",
                    jump.max(1.0 / jump),
                )
            }
            Self::ClockOffset {
                offset_s,
                before_rad,
                after_rad,
                pairs,
            } => write!(
                f,
                "The turns of images and odometry fit best with {offset_s:+.2} s added to the times of the odometry (mean \
                 difference {:.2} instead of {:.2} degrees over {pairs} compared spans): the two clocks differ.",
                after_rad.to_degrees(),
                before_rad.to_degrees()
            ),
        }
    }
}

impl fmt::Display for Support {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.0} % instead of {:.0} % of the matches fit, over {} pairs of frames",
            100.0 * self.found,
            100.0 * self.stated,
            self.pairs
        )
    }
}

/// Two significant digits, without an exponent.
fn significant(value: f64) -> String {
    let digits = if value == 0.0 {
        1
    } else {
        // Between -300 and 300, far inside i32.
        (1 - value.abs().log10().floor() as i32).max(0) as usize
    };
    format!("{value:.digits$}")
}
