//! The errors that a camera file states, as the configuration of a run.

use slam_pipeline::config::Config;

use crate::camera::CameraFile;

impl CameraFile {
    /// `config` with the standard deviations that this file states: they are those of this very camera. Where it states
    /// none the configuration stays as it is.
    #[must_use]
    pub fn considered_in(&self, config: &Config) -> Config {
        let mut config = config.clone();
        let relative = |sigma: Option<f64>, value: f64| sigma.map(|s| s / value);
        let focal = [
            relative(self.sigma.fx, self.fx),
            relative(self.sigma.fy, self.fy),
        ];
        if let Some(sigma) = focal.into_iter().flatten().reduce(f64::max) {
            config.carrier.focal_sigma = sigma;
        }
        // An error of the principal point turns every ray sideways, as one of the mount does.
        let centre = relative(self.sigma.cx, self.fx).unwrap_or(0.0);
        let yaw = self.sigma.mount_yaw;
        config.carrier.mount_yaw_sigma =
            yaw.unwrap_or(config.carrier.mount_yaw_sigma).hypot(centre);
        config
    }
}
