//! The formats of calibrations by name.

/// The file format of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFormat {
    /// `camera.toml` of a sequence folder.
    Toml,
    /// Kalibr's `camchain.yaml`.
    Kalibr,
    /// OpenCV's `FileStorage`.
    OpenCv,
    /// ROS `camera_info`, as `camera_calibration` writes it and `topic echo` prints it.
    Ros,
    /// Settings of ORB-SLAM 2 or 3.
    OrbSlam,
    /// camodocal's camera file, of VINS.
    Camodocal,
    /// COLMAP's cameras, text or binary.
    Colmap,
    /// EuRoC's `sensor.yaml`.
    Euroc,
    /// KITTI's calibration of a raw recording or an odometry sequence.
    Kitti,
}

impl CameraFormat {
    /// The format's name in a sentence.
    pub(super) fn title(self) -> &'static str {
        match self {
            CameraFormat::Toml => "a camera.toml",
            CameraFormat::Kalibr => "a Kalibr camchain",
            CameraFormat::OpenCv => "an OpenCV FileStorage",
            CameraFormat::Ros => "a ROS camera_info",
            CameraFormat::OrbSlam => "settings of ORB-SLAM",
            CameraFormat::Camodocal => "a camera file of VINS",
            CameraFormat::Colmap => "cameras of COLMAP",
            CameraFormat::Euroc => "a sensor.yaml of EuRoC",
            CameraFormat::Kitti => "a calibration of KITTI",
        }
    }
}
