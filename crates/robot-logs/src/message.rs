//! The message types that are read, and their decoding.
//!
//! The definitions are those of ROS 1 Noetic and ROS 2 `common_interfaces`, which agree but for the header: that of ROS 1
//! begins with a sequence number.

use crate::contents::Serialisation;
use crate::error::Mismatch;
use crate::wire::Wire;

/// The type of a topic's messages, of those that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum MessageKind {
    /// `sensor_msgs/Image`
    Image,
    /// `sensor_msgs/CompressedImage`
    CompressedImage,
    /// `sensor_msgs/CameraInfo`
    CameraInfo,
    /// `nav_msgs/Odometry`
    Odometry,
    /// `geometry_msgs/Twist`
    Twist,
    /// `geometry_msgs/TwistStamped`
    TwistStamped,
    /// `geometry_msgs/TwistWithCovarianceStamped`
    TwistWithCovarianceStamped,
    /// `sensor_msgs/JointState`
    JointState,
    /// `tf2_msgs/TFMessage` or `tf/tfMessage`
    Transforms,
}

impl MessageKind {
    /// The kind of a type name; `package/msg/Name` and `package/Name` are the same.
    pub fn from_type_name(name: &str) -> Option<Self> {
        Some(match name.replacen("/msg/", "/", 1).as_str() {
            "sensor_msgs/Image" => Self::Image,
            "sensor_msgs/CompressedImage" => Self::CompressedImage,
            "sensor_msgs/CameraInfo" => Self::CameraInfo,
            "nav_msgs/Odometry" => Self::Odometry,
            "geometry_msgs/Twist" => Self::Twist,
            "geometry_msgs/TwistStamped" => Self::TwistStamped,
            "geometry_msgs/TwistWithCovarianceStamped" => Self::TwistWithCovarianceStamped,
            "sensor_msgs/JointState" => Self::JointState,
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Self::Transforms,
            _ => return None,
        })
    }

    /// Whether the messages begin with a header.
    pub(crate) fn has_header(self) -> bool {
        !matches!(self, Self::Twist | Self::Transforms)
    }
}

/// Time and frame of a message.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    /// Time stamp in nanoseconds; zero where the sender did not set it.
    pub stamp_ns: i64,
    /// Name of the coordinate frame.
    pub frame_id: String,
}

/// An image as its driver sent it; [`Image::pixels`] brings it into order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Time and frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Name of the encoding, as `mono8` or `bayer_rggb8`.
    pub encoding: String,
    /// Whether samples of two bytes have their high byte first.
    pub big_endian: bool,
    /// Bytes from one row to the next.
    pub step: u32,
    /// `step * height` bytes.
    pub data: Vec<u8>,
}

/// An image as a file in the message, JPEG or PNG.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompressedImage {
    /// Time and frame.
    pub header: Header,
    /// Name of the format as the driver wrote it, as `jpeg` or `rgb8; jpeg compressed bgr8`.
    pub format: String,
    /// The file.
    pub data: Vec<u8>,
}

/// A camera calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    /// Time and frame.
    pub header: Header,
    /// Rows of the calibrated image.
    pub height: u32,
    /// Columns of the calibrated image.
    pub width: u32,
    /// Name of the lens model, as `plumb_bob`.
    pub distortion_model: String,
    /// Coefficients of the lens.
    pub d: Vec<f64>,
    /// Camera matrix, row by row.
    pub k: [f64; 9],
    /// Rectification, row by row.
    pub r: [f64; 9],
    /// Projection after rectification, row by row.
    pub p: [f64; 12],
    /// Pixels that the driver merged into one, across and down; zero means one.
    pub binning: [u32; 2],
    /// Part of the image: first column, first row, rows, columns; all zero means the whole image.
    pub roi: [u32; 4],
}

/// Linear and angular velocity, m/s and rad/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Along x, y, z.
    pub linear: [f64; 3],
    /// About x, y, z.
    pub angular: [f64; 3],
}

/// Position in metres and unit quaternion x, y, z, w.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// x, y, z.
    pub position: [f64; 3],
    /// x, y, z, w.
    pub orientation: [f64; 4],
}

/// Pose and velocity of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Time, and the frame of the pose.
    pub header: Header,
    /// The frame of the robot, in which the twist is given.
    pub child_frame_id: String,
    /// Pose of the robot.
    pub pose: Pose,
    /// Velocity of the robot.
    pub twist: Twist,
}

/// A velocity with its time; of a plain `Twist` the header is empty.
#[derive(Debug, Clone, PartialEq)]
pub struct TwistStamped {
    /// Time and frame.
    pub header: Header,
    /// The velocity.
    pub twist: Twist,
}

/// Angles and speeds of joints; lists that the sender left out are empty.
#[derive(Debug, Clone, PartialEq)]
pub struct JointState {
    /// Time and frame.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Angles in rad, or metres.
    pub position: Vec<f64>,
    /// Speeds in rad/s, or m/s.
    pub velocity: Vec<f64>,
}

/// The pose of frame `child_frame_id` in the frame of the header.
#[derive(Debug, Clone, PartialEq)]
pub struct TransformStamped {
    /// Time and parent frame.
    pub header: Header,
    /// The frame that is placed.
    pub child_frame_id: String,
    /// Origin and axes of the child in the parent.
    pub transform: Pose,
}

/// A decoded message.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Message {
    /// An image.
    Image(Image),
    /// An image in a file format.
    CompressedImage(CompressedImage),
    /// A calibration.
    CameraInfo(Box<CameraInfo>),
    /// Pose and velocity.
    Odometry(Box<Odometry>),
    /// A velocity, with or without a header.
    Twist(TwistStamped),
    /// Angles of joints.
    JointState(JointState),
    /// Places of frames.
    Transforms(Vec<TransformStamped>),
}

/// Decodes a message.
pub(crate) fn decode(
    kind: MessageKind,
    serialisation: Serialisation,
    bytes: &[u8],
) -> Result<Message, Mismatch> {
    let wire = &mut Wire::new(bytes, serialisation)?;
    Ok(match kind {
        MessageKind::Image => Message::Image(image(wire)?),
        MessageKind::CompressedImage => Message::CompressedImage(CompressedImage {
            header: header(wire)?,
            format: wire.text()?,
            data: wire.bytes()?.to_vec(),
        }),
        MessageKind::CameraInfo => Message::CameraInfo(Box::new(camera_info(wire)?)),
        MessageKind::Odometry => {
            let header = header(wire)?;
            let child_frame_id = wire.text()?;
            let pose = pose(wire)?;
            wire.f64s::<36>()?;
            Message::Odometry(Box::new(Odometry {
                header,
                child_frame_id,
                pose,
                twist: twist(wire)?,
            }))
        }
        MessageKind::Twist => Message::Twist(TwistStamped {
            header: Header::default(),
            twist: twist(wire)?,
        }),
        MessageKind::TwistStamped | MessageKind::TwistWithCovarianceStamped => {
            Message::Twist(TwistStamped {
                header: header(wire)?,
                twist: twist(wire)?,
            })
        }
        MessageKind::JointState => {
            let header = header(wire)?;
            let count = wire.count(4)?;
            let name = (0..count).map(|_| wire.text()).collect::<Result<_, _>>()?;
            Message::JointState(JointState {
                header,
                name,
                position: wire.f64_list()?,
                velocity: wire.f64_list()?,
            })
        }
        MessageKind::Transforms => {
            let count = wire.count(64)?;
            let transforms = (0..count)
                .map(|_| transform(wire))
                .collect::<Result<_, _>>();
            Message::Transforms(transforms?)
        }
    })
}

/// The time stamp at the beginning of a message with a header.
pub(crate) fn stamp(serialisation: Serialisation, bytes: &[u8]) -> Result<i64, Mismatch> {
    stamp_of(&mut Wire::new(bytes, serialisation)?)
}

fn stamp_of(wire: &mut Wire<'_>) -> Result<i64, Mismatch> {
    if wire.is_ros1() {
        let _sequence = wire.u32()?;
        let seconds = i64::from(wire.u32()?);
        return Ok(seconds * 1_000_000_000 + i64::from(wire.u32()?));
    }
    let seconds = i64::from(wire.i32()?);
    Ok(seconds * 1_000_000_000 + i64::from(wire.u32()?))
}

fn header(wire: &mut Wire<'_>) -> Result<Header, Mismatch> {
    Ok(Header {
        stamp_ns: stamp_of(wire)?,
        frame_id: wire.text()?,
    })
}

fn image(wire: &mut Wire<'_>) -> Result<Image, Mismatch> {
    Ok(Image {
        header: header(wire)?,
        height: wire.u32()?,
        width: wire.u32()?,
        encoding: wire.text()?,
        big_endian: wire.u8()? != 0,
        step: wire.u32()?,
        data: wire.bytes()?.to_vec(),
    })
}

fn camera_info(wire: &mut Wire<'_>) -> Result<CameraInfo, Mismatch> {
    Ok(CameraInfo {
        header: header(wire)?,
        height: wire.u32()?,
        width: wire.u32()?,
        distortion_model: wire.text()?,
        d: wire.f64_list()?,
        k: wire.f64s()?,
        r: wire.f64s()?,
        p: wire.f64s()?,
        binning: [wire.u32()?, wire.u32()?],
        roi: [wire.u32()?, wire.u32()?, wire.u32()?, wire.u32()?],
    })
}

fn twist(wire: &mut Wire<'_>) -> Result<Twist, Mismatch> {
    Ok(Twist {
        linear: wire.f64s()?,
        angular: wire.f64s()?,
    })
}

fn pose(wire: &mut Wire<'_>) -> Result<Pose, Mismatch> {
    Ok(Pose {
        position: wire.f64s()?,
        orientation: wire.f64s()?,
    })
}

fn transform(wire: &mut Wire<'_>) -> Result<TransformStamped, Mismatch> {
    Ok(TransformStamped {
        header: header(wire)?,
        child_frame_id: wire.text()?,
        transform: pose(wire)?,
    })
}
