//! Bytes that are no state: no panic, and memory in proportion to them.

use slam_pipeline::Slam;

use crate::drive::{Drive, config, rig};
use crate::mutations::{Memory, attack};

/// Trees of shared nodes, which are built from lists of their parts.
const STATE: Memory = Memory {
    per_byte: 30,
    always: 4 << 20,
};

#[test]
fn states_of_any_bytes() {
    let drive = Drive::new(5);
    let config = config(3, 1);
    let genuine: Vec<Vec<u8>> = [1, 4, 20]
        .into_iter()
        .map(|frames| {
            let mut slam = Slam::new(rig(), &config).unwrap();
            for frame in 0..frames {
                slam.step(&drive.input(frame), &mut |_| {}).unwrap();
            }
            slam.save_state().unwrap()
        })
        .collect();
    attack(
        "state",
        &genuine,
        STATE,
        |_| (),
        |bytes| {
            if let Ok(slam) = Slam::restore_state(rig(), &config, bytes) {
                drop((slam.landmarks(), slam.smoothed_path(), slam.known_map()));
            }
        },
    );
}
