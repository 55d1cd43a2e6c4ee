//! Time to paint the skins of a scene, to render one frame, and to render one board.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use wall_scenes::{BoardRenderer, BoardSetSpec, Scene, SceneSpec, board_poses};

fn scene(c: &mut Criterion) {
    let Ok(scene) = Scene::new(SceneSpec::wall(1)) else {
        return;
    };
    c.bench_function("skins_wall", |b| b.iter(|| black_box(scene.skins())));
    let skins = scene.skins();
    c.bench_function("frame_320x240", |b| {
        b.iter(|| black_box(scene.render(&skins, black_box(10))));
    });
}

fn board(c: &mut Criterion) {
    let spec = BoardSetSpec::small(1, 1);
    let Ok(camera) = spec.camera() else { return };
    let renderer = BoardRenderer::new(camera);
    let poses = board_poses(&spec.board, &camera, 1, 1);
    c.bench_function("board_320x240", |b| {
        b.iter(|| black_box(renderer.render(&spec.board, &poses[0], &spec.look, 1, 0)));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = scene, board
}
criterion_main!(benches);
