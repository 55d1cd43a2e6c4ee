//! A system that was stored and restored goes on with the same bits, and bytes that are no state are refused.

use slam_pipeline::config::{Config, Method};
use slam_pipeline::{FrameReport, MapUse, Slam};

use crate::drive::{Drive, FRAMES, config, rig};

/// The system after the first `frames` of a drive.
fn after(drive: &Drive, frames: usize) -> Slam {
    let mut slam = Slam::new(rig(), &config(12, 3)).unwrap();
    for i in 0..frames {
        slam.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    slam
}

/// Reports of the frames from `from` on, and the results at the end.
fn rest(mut slam: Slam, drive: &Drive, from: usize) -> (Vec<FrameReport>, String) {
    let reports = (from..FRAMES)
        .map(|i| slam.step(&drive.input(i), &mut |_| {}).unwrap())
        .collect();
    let results = format!("{:?} {:?}", slam.smoothed_path(), slam.landmarks());
    (reports, results)
}

/// Frames 0 (nothing yet), 1 (the first keyframe alone), and others before and behind new draws of the recent path, which
/// ask which particles share their beginnings.
#[test]
fn a_restored_system_goes_on_with_the_same_bits() {
    let drive = Drive::new(11);
    for frames in [0, 1, 2, 9, 10, 11, 20, 25, 33] {
        let unbroken = after(&drive, frames);
        let bytes = unbroken.save_state().unwrap();
        let restored = Slam::restore_state(rig(), &config(12, 3), &bytes).unwrap();
        assert_eq!(restored.frames(), frames);
        // Equal bytes: nothing that was shared is held twice.
        assert!(restored.save_state().unwrap() == bytes, "{frames} frames");
        // The debug text shows every digit of a float that matters to its bits.
        let text = |slam| format!("{:?}", rest(slam, &drive, frames));
        assert!(text(restored) == text(unbroken), "{frames} frames");
    }
}

/// Written out particle by particle, the maps of this state would take twelve times as many landmarks.
#[test]
fn what_particles_share_is_stored_once() {
    let drive = Drive::new(11);
    let few = after(&drive, 25).save_state().unwrap().len();
    let mut more = Slam::new(rig(), &config(36, 3)).unwrap();
    for i in 0..25 {
        more.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    let more = more.save_state().unwrap().len();
    assert!(
        more < 3 * few,
        "{few} bytes with 12 particles, {more} with 36"
    );
}

#[test]
fn bytes_that_are_no_state_are_refused() {
    let drive = Drive::new(11);
    let bytes = after(&drive, 12).save_state().unwrap();
    let refused = |bytes: &[u8], config: &_| {
        Slam::restore_state(rig(), config, bytes)
            .unwrap_err()
            .to_string()
    };
    let own = config(12, 3);
    assert!(refused(&[], &own).starts_with("state of the filter: no state of this version: "));
    let mut longer = bytes.clone();
    longer.extend_from_slice(&[0; 3]);
    assert_eq!(
        refused(&longer, &own),
        "state of the filter: 3 bytes too many"
    );
    assert_eq!(
        refused(&bytes, &config(12, 4)),
        "state of the filter: the seed is that of the configuration"
    );
    assert_eq!(
        refused(&bytes, &config(13, 3)),
        "state of the filter: there are as many particles as the configuration says"
    );
    for length in (0..bytes.len()).step_by(97) {
        refused(&bytes[..length], &own);
    }
}

/// Nothing in damaged bytes makes the reader panic; what it takes for a state may be stepped, with or without success.
#[test]
fn a_damaged_state_never_panics() {
    let drive = Drive::new(11);
    let bytes = after(&drive, 8).save_state().unwrap();
    let mut restored = 0;
    for position in (0..bytes.len()).step_by(61) {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[position] ^= flip;
            if let Ok(mut slam) = Slam::restore_state(rig(), &config(12, 3), &damaged) {
                restored += 1;
                if restored % 20 == 0 {
                    drop(slam.step(&drive.input(8), &mut |_| {}));
                }
            }
        }
    }
    assert!(restored > 20, "most bytes are those of floats");
}

#[test]
fn the_method_paper_says_that_it_is_not_stored() {
    let mut config = Config::default();
    config.filter.method = Method::Paper;
    let slam = Slam::new(rig(), &config.check().unwrap()).unwrap();
    assert_eq!(
        slam.save_state().unwrap_err().to_string(),
        "state of the filter: the method paper searches a k-d forest, which is not stored; exact and conventional have none"
    );
}

/// A robot that woke up in a map, while it is lost and after it was found: the use of the map is stored with the state.
#[test]
fn a_system_in_a_map_is_restored_with_its_use_of_the_map() {
    let drive = Drive::new(11);
    let map = after(&drive, 20).known_map();
    for usage in [MapUse::Extend, MapUse::Localise] {
        for frames in [0, 1, 6] {
            let mut slam = Slam::with_map(rig(), &config(12, 3), &map, usage).unwrap();
            for i in 0..frames {
                slam.step(&drive.input(i), &mut |_| {}).unwrap();
            }
            let bytes = slam.save_state().unwrap();
            let restored = Slam::restore_state(rig(), &config(12, 3), &bytes).unwrap();
            assert!(restored.save_state().unwrap() == bytes, "{usage:?}");
            let text = |slam: Slam| {
                let map = format!("{:?}", slam.known_map());
                format!("{:?} {map}", rest(slam, &drive, frames))
            };
            assert!(text(restored) == text(slam), "{usage:?} after {frames}");
        }
    }
}
