//! Pictures of a checkerboard with known truth: to try `mono-slam calibrate` without a camera, and to test it.
//!
//! [`poses`] draws poses at which the whole board is visible, [`Renderer`] draws the images (see `render`), [`write_set`]
//! puts a set into a folder: `images/board_NN.png`, the true `camera.toml`, and `corners.csv` with every true corner.

mod pose;
mod render;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Context;
use camera_calibration::BoardSize;
use image::GrayImage;
use mono_geometry::{Camera, Distortion, GeometryError, Pinhole};

pub use pose::poses;
pub use render::{Look, Picture, Renderer};

/// A printed board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Inner corners.
    pub size: BoardSize,
    /// Side of a square, metres.
    pub square_m: f64,
}

/// A set of pictures of one board by one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct SetSpec {
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

impl SetSpec {
    /// Pictures of 320 x 240 of a 9x6 board with squares of 40 mm.
    pub fn small(count: usize, seed: u64) -> SetSpec {
        SetSpec {
            board: Board {
                size: BoardSize {
                    columns: 9,
                    rows: 6,
                },
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
    pub fn camera(&self) -> Result<Camera, GeometryError> {
        let (width, height) = self.image;
        let focal = 0.66 * width as f64;
        Camera::new(
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
        )
    }
}

/// Renders a set into `folder`; equal specifications give equal bytes.
///
/// # Errors
/// The folder cannot be written.
pub fn write_set(spec: &SetSpec, folder: &Path) -> anyhow::Result<()> {
    let camera = spec.camera()?;
    let renderer = Renderer::new(camera);
    let images = folder.join("images");
    fs::create_dir_all(&images).with_context(|| format!("cannot create {}", images.display()))?;
    let mut corners = String::from("image,corner,x_px,y_px\n");
    for (index, pose) in poses(&spec.board, &camera, spec.count, spec.seed)
        .iter()
        .enumerate()
    {
        let picture = renderer.render(&spec.board, pose, &spec.look, spec.seed, index as u64);
        let name = format!("board_{index:02}.png");
        let (width, height) = (spec.image.0 as u32, spec.image.1 as u32);
        GrayImage::from_raw(width, height, picture.image.pixels)
            .context("the picture has not the size of its camera")?
            .save(images.join(&name))
            .with_context(|| format!("cannot write {name}"))?;
        for (corner, [x, y]) in picture.corners.iter().enumerate() {
            let _ = writeln!(corners, "{name},{corner},{x:.6},{y:.6}");
        }
    }
    fs::write(folder.join("corners.csv"), corners).context("cannot write corners.csv")?;
    fs::write(folder.join("camera.toml"), camera_toml(&camera)).context("cannot write camera.toml")
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
