//! The identities in the reports: they make tracks of the features.

use std::collections::BTreeMap;

use slam_pipeline::{KeypointFate, Slam};

use crate::drive::{Drive, FRAMES, config, rig};

#[test]
fn the_identity_of_a_feature_leads_from_its_first_sighting_to_all_later_ones() {
    let drive = Drive::new(5);
    let mut slam = Slam::new(rig(), &config(10, 5)).unwrap();
    let mut first: BTreeMap<u32, [u8; 128]> = BTreeMap::new();
    let (mut again, mut strangers) = (0, 0);
    for i in 0..FRAMES {
        let report = slam.step(&drive.input(i), &mut |_| {}).unwrap();
        let descriptors = &drive.features[i].descriptors;
        for (keypoint, descriptor) in report.keypoints.iter().zip(descriptors) {
            assert_eq!(
                keypoint.landmark.is_none(),
                keypoint.fate == KeypointFate::Unused
            );
            let Some(id) = keypoint.landmark else {
                continue;
            };
            match keypoint.fate {
                KeypointFate::New => {
                    assert!(first.insert(id, *descriptor).is_none(), "{id} came twice");
                }
                KeypointFate::Matched => {
                    // The drive gives each point random bytes and each sighting at most 7 more.
                    let born = first.get(&id).expect("it was new once");
                    let same = born
                        .iter()
                        .zip(descriptor)
                        .all(|(a, b)| a.abs_diff(*b) <= 7);
                    again += 1;
                    strangers += usize::from(!same);
                }
                KeypointFate::Outlier | KeypointFate::Unused => {}
            }
        }
    }
    // With identities off by one nearly all would be strangers.
    assert!(again > 1000, "{again} sightings");
    assert!(strangers * 100 < again, "{strangers} of {again}");
    let mapped = slam.landmarks();
    assert!(mapped.iter().all(|l| first.contains_key(&l.id)));
}
