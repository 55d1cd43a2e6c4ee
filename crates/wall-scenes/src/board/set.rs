//! A set of pictures of one board by one camera, with known truth.
//!
//! [`write_board_set`] puts it into a folder: `images/board_NN.png`, the true `camera.toml`, and `corners.csv` with every
//! true corner.

use super::pose::board_poses;
use super::render::{BoardRenderer, Look};
use super::shape::Board;
use crate::error::SceneError;
use crate::files::{create_folder, write_file};
use crate::image::CompressionType;
use mono_geometry::{Camera, Distortion, Pinhole};
use std::fmt::Write as _;
use std::path::Path;

/// A set of pictures of one board by one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardSetSpec {
    /// The board.
    pub board: Board,
    /// Image width and height, pixels.
    pub image: (usize, usize),
    /// Number of pictures.
    pub count: usize,
    /// Seed of poses, clutter and noise.
    pub seed: u64,
    /// Light, blur and noise.
    pub look: Look,
}

impl BoardSetSpec {
    /// Pictures of 320 x 240 of a 9x6 board with squares of 40 mm.
    pub fn small(count: usize, seed: u64) -> BoardSetSpec {
        BoardSetSpec {
            board: Board {
                columns: 9,
                rows: 6,
                square_m: 0.04,
            },
            image: (320, 240),
            count,
            seed,
            look: Look::default(),
        }
    }

    /// The camera of the set: a lens of about 75 degrees that bends straight lines visibly.
    ///
    /// # Errors
    /// An image without pixels.
    pub fn camera(&self) -> Result<Camera, SceneError> {
        let (width, height) = self.image;
        let focal = 0.66 * width as f64;
        Ok(Camera::new(
            Pinhole {
                width,
                height,
                fx: focal,
                fy: 1.004 * focal,
                cx: 0.487 * width as f64,
                cy: 0.513 * height as f64,
            },
            Distortion::Radtan {
                k1: -0.28,
                k2: 0.09,
                p1: 0.0006,
                p2: -0.0004,
                k3: 0.0,
            },
        )?)
    }
}

/// Renders a set into `folder`; equal specifications give equal bytes.
///
/// # Errors
/// The folder cannot be written.
pub fn write_board_set(spec: &BoardSetSpec, folder: &Path) -> Result<(), SceneError> {
    let camera = spec.camera()?;
    let renderer = BoardRenderer::new(camera);
    let images = folder.join("images");
    create_folder(&images)?;
    let mut corners = String::from("image,corner,x_px,y_px\n");
    for (index, pose) in board_poses(&spec.board, &camera, spec.count, spec.seed)
        .iter()
        .enumerate()
    {
        let picture = renderer.render(&spec.board, pose, &spec.look, spec.seed, index as u64);
        let name = format!("board_{index:02}.png");
        let file = images.join(&name);
        write_file(&file, &picture.image.to_png(CompressionType::Fast, &file)?)?;
        for (corner, [x, y]) in picture.corners.iter().enumerate() {
            let _ = writeln!(corners, "{name},{corner},{x:.6},{y:.6}");
        }
    }
    write_file(&folder.join("corners.csv"), corners.as_bytes())?;
    write_file(&folder.join("camera.toml"), camera_toml(&camera).as_bytes())
}

/// The true camera in the format of a sequence folder.
fn camera_toml(camera: &Camera) -> String {
    let pinhole = camera.pinhole();
    let mut text = format!(
        "# the camera that rendered the pictures beside this file; pixel (0,0) is the centre of the top-left pixel\n\
         width = {}\nheight = {}\nmodel = \"pinhole\"\nfx = {}\nfy = {}\ncx = {}\ncy = {}\n",
        pinhole.width, pinhole.height, pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy
    );
    text.push_str("\n[distortion]\nmodel = \"radtan\"\n");
    for (name, value) in camera
        .distortion()
        .parameter_names()
        .iter()
        .zip(camera.distortion().parameters())
    {
        let _ = writeln!(text, "{name} = {value}");
    }
    text
}
