//! Scenes by name.

use anyhow::bail;
use wall_scenes::SceneSpec;

/// The scene of a name with a seed.
///
/// # Errors
/// Another name.
pub(crate) fn scene(name: &str, seed: u64) -> anyhow::Result<SceneSpec> {
    match name {
        "wall" => Ok(SceneSpec::wall(seed)),
        "room" => Ok(SceneSpec::room(seed)),
        other => bail!("no scene `{other}`: wall or room"),
    }
}
