//! A scene on disk, in the sequence format of the workspace.
//!
//! `images/NNNNNN.png`, `times.txt`, `camera.toml`, `odometry.csv`,
//! `groundtruth_planar.csv` (body), `groundtruth.txt` (TUM, camera-to-world with the first camera as
//! world) and `scene.json`, from which [`Scene::read`] builds the same scene again.
//! Each file is written under a temporary name and renamed.

use crate::camera::{CX, CY, HEIGHT, Lens, POSITION_IN_BODY, WIDTH};
use crate::error::SceneError;
use crate::files::{create_folder, read_file, write_file};
use crate::image::CompressionType;
use crate::layout::walk;
use crate::odometry::OdometryRow;
use crate::scene::Scene;
use crate::spec::SceneSpec;
use crate::walker;
use rayon::prelude::*;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

impl Scene {
    /// Renders and writes the whole sequence into a folder, which is created.
    ///
    /// # Errors
    /// The folder already holds images, or cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), SceneError> {
        let images = folder.join("images");
        if images.exists() {
            return Err(SceneError::Occupied(folder.to_path_buf()));
        }
        create_folder(&images)?;
        let skins = self.skins();
        (0..self.images()).into_par_iter().try_for_each(|frame| {
            let file = images.join(format!("{frame:06}.png"));
            write_file(
                &file,
                &self
                    .render(&skins, frame)
                    .to_png(CompressionType::Default, &file)?,
            )
        })?;
        for (name, text) in [
            ("times.txt", self.times()),
            ("camera.toml", self.camera_toml()),
            ("odometry.csv", odometry_csv(self.odometry())),
            ("groundtruth_planar.csv", self.planar_truth()),
            ("groundtruth.txt", self.camera_truth()),
            ("scene.json", self.description()),
        ] {
            write_file(&folder.join(name), text.as_bytes())?;
        }
        Ok(())
    }

    /// Builds the scene a `scene.json` describes.
    ///
    /// # Errors
    /// The file is missing, is not a scene description, or describes an impossible scene.
    pub fn read(file: &Path) -> Result<Self, SceneError> {
        let text = read_file(file)?;
        let wrong = |source| SceneError::NoDescription {
            file: file.to_path_buf(),
            source,
        };
        let value: serde_json::Value = serde_json::from_str(&text).map_err(wrong)?;
        let spec: SceneSpec = serde_json::from_value(value["spec"].clone()).map_err(wrong)?;
        Self::new(spec)
    }

    fn times(&self) -> String {
        let mut text = String::new();
        for time in &self.path().times_s {
            let _ = writeln!(text, "{time:.6}");
        }
        text
    }

    fn planar_truth(&self) -> String {
        let mut text = String::from("frame,t_s,x_m,y_m,phi_rad\n");
        for (frame, (time, pose)) in self
            .path()
            .times_s
            .iter()
            .zip(&self.path().poses)
            .enumerate()
        {
            let _ = writeln!(
                text,
                "{frame},{time:.6},{:.9},{:.9},{:.9}",
                pose.x, pose.y, pose.phi
            );
        }
        text
    }

    fn camera_truth(&self) -> String {
        let mut text = String::from(
            "# timestamp tx ty tz qx qy qz qw, camera-to-world, world = first camera\n",
        );
        let first_camera_from_world = self.world_from_camera(0).inverse();
        for (frame, time) in self.path().times_s.iter().enumerate() {
            let pose = first_camera_from_world * self.world_from_camera(frame);
            let (t, q) = (pose.translation.vector, pose.rotation);
            let _ = writeln!(
                text,
                "{time:.6} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
                t.x, t.y, t.z, q.i, q.j, q.k, q.w
            );
        }
        text
    }

    /// Specification and geometry; rectangles as their two extreme corners and normal.
    fn description(&self) -> String {
        let all = &self.world.facets;
        let walker = self.spec.mishaps.walker;
        let standing = all.len() - if walker { walker::FACES } else { 0 };
        let facets: Vec<_> = all[..standing]
            .iter()
            .map(|f| json!([f.axis, f.normal_sign, f.offset, f.low, f.high]))
            .collect();
        let mut value = json!({
            "spec": self.spec,
            "facets": {
                "columns": ["axis", "normal_sign", "offset_m", "low_m", "high_m"],
                "note": "rectangles on x[axis] = offset_m in world axes; low_m and high_m along the two next axes in cyclic order",
                "rows": facets,
            },
        });
        let told = self.spec.told();
        if !told.is_empty() {
            value["told"] = json!(told);
        }
        if walker {
            let way = walk(&self.spec);
            let places = self.path().times_s.iter().map(|&time_s| way.at(time_s));
            value["walker"] = json!({
                "note": "centre of the block at each image, metres in world axes",
                "rows": places.collect::<Vec<_>>(),
            });
        }
        format!("{value}\n")
    }

    /// The stated calibration.
    fn camera_toml(&self) -> String {
        let (pinhole, mount) = self.stated_calibration();
        let (fx, fy) = (pinhole.fx, pinhole.fy);
        let lens = match self.spec().lens() {
            Lens::Pinhole => "",
            Lens::Equidistant(_) => {
                "\n[distortion]   # equidistant: the radius is the focal length times the angle\n\
                 model = \"kannala-brandt\"\nk1 = 0.0\nk2 = 0.0\nk3 = 0.0\nk4 = 0.0\n"
            }
        };
        let axes = mount.body_from_camera.rotation.matrix();
        let [r0, r1, r2] = [0, 1, 2].map(|row| [0, 1, 2].map(|column| axes[(row, column)]));
        format!(
            "# pixel (0,0) is the centre of the top-left pixel\n\
             width = {WIDTH}\nheight = {HEIGHT}\nmodel = \"pinhole\"\n\
             fx = {fx:?}\nfy = {fy:?}\ncx = {CX:?}\ncy = {CY:?}\n\n\
             [mount]   # pose of the camera in the robot body; body axes x forward, y left, z up\n\
             position_in_body = {POSITION_IN_BODY:?}   # metres\n\
             # columns: camera x (right), y (down), z (forward) in body axes; it looks to the left\n\
             rotation_body_from_camera = [{r0:?}, {r1:?}, {r2:?}]\n{lens}"
        )
    }
}

fn odometry_csv(rows: &[OdometryRow]) -> String {
    let mut text = String::from("t_s,v_mps,omega_radps\n");
    for row in rows {
        let _ = writeln!(
            text,
            "{:.6},{:.9},{:.9}",
            row.t_s, row.v_mps, row.omega_radps
        );
    }
    text
}
