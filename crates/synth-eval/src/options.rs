//! The questions a study is asked.

use std::path::PathBuf;

/// The extent of a study and the folder of its results.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// Three seeds and the five most telling estimators where nothing else is said.
    pub quick: bool,
    /// Names of scenes; the wall when there is neither a scene nor a sequence.
    pub scenes: Vec<String>,
    /// The scenes' keypoints are simulated from points on their surfaces, without images.
    pub points: bool,
    /// Folders of recorded sequences.
    pub sequences: Vec<PathBuf>,
    /// Frames of the scenes; none for what each scene has.
    pub frames: Option<usize>,
    /// First and last seed; none for the default.
    pub seeds: Option<(u64, u64)>,
    /// Estimators, `dead-reckoning` or `FAMILY:PARTICLES`; none for the default.
    pub methods: Vec<String>,
    /// The exact filter and its ablations run too; alone where no estimator is named.
    pub ablations: bool,
    /// The filters run the shipped defaults instead of the exact noise of the scene.
    pub default_config: bool,
    /// The filters run this configuration file.
    pub config: Option<PathBuf>,
    /// The batch solution over the associations of each run is computed as its limit.
    pub batch: bool,
    /// This part of how many parts of the work is done.
    pub shard: Option<(u32, u32)>,
    /// Folder of the results; created.
    pub out: PathBuf,
    /// Results of an earlier study to compare with.
    pub compare: Option<PathBuf>,
}
