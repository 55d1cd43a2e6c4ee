#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`RobotLog::open`] recognises a log by its contents and lists its [`Topic`]s; [`RobotLog::handles`] gives the messages
//! of some of them in the order of their times, and [`RobotLog::message`] reads and decodes one. An image stays in the
//! file until it is asked for.
//!
//! The types read are Image, `CompressedImage`, `CameraInfo` and `JointState` of `sensor_msgs`, Odometry of `nav_msgs`, Twist,
//! `TwistStamped` and `TwistWithCovarianceStamped` of `geometry_msgs`, `TFMessage` of `tf2_msgs` and `tfMessage` of `tf`.

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
