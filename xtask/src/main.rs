//! Workspace tasks.
use std::path::Path;
fn main() -> anyhow::Result<()> {
    let a: Vec<String> = std::env::args().collect();
    let s = if a[1] == "room" { xtask::scene::SceneSpec::room(a[3].parse()?) } else { xtask::scene::SceneSpec::wall(a[3].parse()?) };
    let t = std::time::Instant::now();
    let sc = xtask::scene::Scene::new(s)?;
    println!("{:?}", t.elapsed());
    sc.write(Path::new(&a[2]))?;
    if a.len() > 4 {
        // dump depth maps: f32 per frame
        let mut out = Vec::new();
        for f in 0..sc.spec().frames { for v in 0..240 { for u in 0..320 {
            let d = sc.depth_at(f, u as f64, v as f64).unwrap_or(0.0) as f32;
            out.extend(d.to_le_bytes());
        } } }
        std::fs::write(&a[4], out)?;
    }
    println!("{:?}", t.elapsed());
    Ok(())
}
