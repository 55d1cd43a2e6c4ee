//! Matches a simulated frame to a map and to the frame before it.

#[path = "../tests/it/scene.rs"]
#[expect(dead_code, reason = "the example uses a part")]
mod scene;

use feature_kdtree::{
    Descriptor, DescriptorIndex, IndexError, KdForest, KdForestParams, match_descriptors,
    match_mutual,
};
use scene::Scene;

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), IndexError> {
    let mut scene = Scene::new(3, 60);
    let landmarks = scene.entries(3000);
    let mut map = KdForest::new(KdForestParams::default())?;
    for (id, descriptor) in (0..).zip(&landmarks) {
        map.insert(id, descriptor)?;
    }

    let view = |scene: &mut Scene| -> Vec<Descriptor> {
        let seen = landmarks.iter().step_by(10);
        seen.map(|landmark| scene.seen_again(landmark, 9.0))
            .collect()
    };
    let (before, now) = (view(&mut scene), view(&mut scene));

    let to_map = match_descriptors(&now, &map, 0.7)?;
    let right = to_map.iter().filter(|found| found.id == 10 * found.query);
    println!(
        "map:   {} of {} keypoints matched, {} of them rightly",
        to_map.len(),
        now.len(),
        right.count()
    );

    let to_before = match_mutual(&now, &before, 0.7)?;
    let right = to_before.iter().filter(|found| found.id == found.query);
    println!(
        "frame: {} of {} keypoints matched, {} of them rightly",
        to_before.len(),
        now.len(),
        right.count()
    );
    Ok(())
}
