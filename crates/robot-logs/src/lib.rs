//! Logs of robots: ROS 1 bags and ROS 2 bags as lists of topics and messages, without ROS and without C.
//!
//! [`RobotLog::open`] recognises a log by its contents and lists its [`Topic`]s; [`RobotLog::handles`] gives the messages
//! of some of them in the order of their times, and [`RobotLog::message`] reads and decodes one. An image stays in the
//! file until it is asked for.
//!
//! | container | compression | types |
//! |---|---|---|
//! | ROS 1 bag, version 2.0 | none, lz4, bz2 | `sensor_msgs`: Image, CompressedImage, CameraInfo, JointState |
//! | ROS 2 bag as MCAP | none, lz4, zstd | `nav_msgs`: Odometry |
//! | ROS 2 bag as sqlite3 (`.db3`) | none, zstd by message | `geometry_msgs`: Twist, TwistStamped, TwistWithCovarianceStamped |
//! | split into several files, with `metadata.yaml` | | `tf2_msgs`: TFMessage, `tf`: tfMessage |
//!
//! The bytes of a log are not believed: a length is compared with the bytes left before memory is taken for it, and a log
//! that is cut is read as far as it goes, with a sentence in [`RobotLog::notes`].

mod bytes;
mod contents;
mod db3;
mod decompress;
mod error;
mod folder;
mod log;
mod mcap;
mod message;
mod pixels;
mod rosbag1;
mod source;
mod sqlite;
mod wire;

pub use error::LogError;
pub use log::{LogFormat, MessageHandle, RobotLog, Topic};
pub use message::{
    CameraInfo, CompressedImage, Header, Image, JointState, Message, MessageKind, Odometry, Pose,
    TransformStamped, Twist, TwistStamped,
};
pub use pixels::{PixelError, Pixels};

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
