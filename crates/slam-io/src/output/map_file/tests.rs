//! A map reads back bit for bit, and every kind of damage is noticed.

use mono_geometry::{Camera, Distortion, Pinhole, Se2, Se3};
use nalgebra::{Matrix3, Rotation3, Vector3};
use slam_pipeline::{KnownErrors, KnownKeyframe, KnownLandmark};

use super::*;

fn landmarks() -> Vec<MapLandmark> {
    (0..5_u32)
        .map(|id| MapLandmark {
            id: 3 * id,
            position: Vector3::new(f64::from(id) / 3.0, 2.0, 0.1),
            covariance: Matrix3::identity() * (1e-4 * f64::from(1 + id * id * id)),
            observations: 2 + id,
            descriptor: (id % 2 == 0).then(|| Box::new(descriptor(id))),
        })
        .collect()
}

fn descriptor(id: u32) -> [u8; 128] {
    std::array::from_fn(|index| (index as u32 * (id + 1)) as u8)
}

fn known(distortion: Distortion) -> KnownMap {
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 368.8,
        fy: 369.9,
        cx: 159.7,
        cy: 121.5,
    };
    let spread = Matrix3::new(2e-4, 1e-5, -3e-6, 1e-5, 1e-4, 1e-6, -3e-6, 1e-6, 1e-5);
    KnownMap {
        camera: Camera::new(pinhole, distortion).unwrap(),
        keyframes: (0..3)
            .map(|index| {
                let phi = 0.1 * f64::from(index) / 3.0;
                KnownKeyframe {
                    world_from_camera: Se3::new(
                        Rotation3::from_euler_angles(-1.5, 0.02, phi),
                        Vector3::new(0.3 * f64::from(index), 1.0 / 3.0, 0.25),
                    ),
                    body: Se2::new(0.3 * f64::from(index), 0.0, phi),
                    // The first keyframe is the origin, known exactly.
                    covariance: spread * f64::from(index),
                }
            })
            .collect(),
        // The first keyframe has no error, the third has that of the second and one of its own.
        errors: KnownErrors {
            keyframes: vec![0, 2],
            rows: vec![vec![Matrix3::zeros()], vec![Matrix3::zeros(), spread]],
        },
        landmarks: [0, 6, 12, 40]
            .map(|id| KnownLandmark {
                id,
                anchor: id % 3,
                parameters: Vector3::new(0.1, -0.2, 1.0 / f64::from(3 + id)),
                covariance: spread,
                descriptor: descriptor(id / 3),
                observations: 2 + id,
                existence: 2.5,
                last_direction: Vector3::new(0.6, 0.8, 0.0),
            })
            .to_vec(),
    }
}

fn radtan() -> Distortion {
    Distortion::Radtan {
        k1: -0.28,
        k2: 0.07,
        p1: 1e-4,
        p2: -2e-4,
        k3: 1e-3,
    }
}

fn decoded(bytes: &[u8]) -> Result<MapFile, OutputError> {
    decode_map(Path::new("map.slam"), bytes)
}

fn message(bytes: &[u8]) -> String {
    decoded(bytes).unwrap_err().to_string()
}

/// The same bytes after a change, with the checksum that belongs to them.
fn changed(bytes: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut content = bytes[..bytes.len() - 4].to_vec();
    change(&mut content);
    let checksum = crc32fast::hash(&content);
    content.extend_from_slice(&checksum.to_le_bytes());
    content
}

/// The checksum is the last four bytes: the CRC-32 of IEEE 802.3, whose check value is public.
#[test]
fn val_the_checksum_is_crc_32() {
    assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
    let bytes = encode_map(&landmarks(), None);
    let (content, checksum) = bytes.split_last_chunk::<4>().unwrap();
    assert_eq!(u32::from_le_bytes(*checksum), crc32fast::hash(content));
}

#[test]
fn the_map_reads_back_bit_for_bit_with_every_lens() {
    for (landmarks, known) in [
        (landmarks(), None),
        (Vec::new(), None),
        (landmarks(), Some(known(Distortion::None))),
        (landmarks(), Some(known(radtan()))),
        (
            Vec::new(),
            Some(known(Distortion::Rational {
                k1: 0.1,
                k2: 0.2,
                p1: 1e-3,
                p2: 2e-3,
                k3: 0.03,
                k4: 0.11,
                k5: 0.22,
                k6: 0.033,
            })),
        ),
        (
            landmarks(),
            Some(known(Distortion::KannalaBrandt {
                k1: 0.01,
                k2: -0.002,
                k3: 1e-4,
                k4: 1e-5,
            })),
        ),
    ] {
        let bytes = encode_map(&landmarks, known.as_ref());
        let read = decoded(&bytes).unwrap();
        assert_eq!(read, MapFile { landmarks, known });
        let again = encode_map(&read.landmarks, read.known.as_ref());
        assert_eq!(again, bytes, "equal maps are equal bytes");
    }
}

/// The positions of the documented fields, by hand.
#[test]
fn the_bytes_are_where_the_table_says() {
    let map = known(radtan());
    let bytes = encode_map(&landmarks(), Some(&map));
    assert_eq!(&bytes[..16], b"MONOSLAM\x02\0\0\0\x05\0\0\0");
    assert_eq!(&bytes[16..20], b"LAND");
    // 5 landmarks of 105 bytes; those of ids 0, 6 and 12 have their descriptors in ANCH.
    assert_eq!(bytes[20..28], (4 + 5 * 105_u64).to_le_bytes());
    assert_eq!(bytes[28..32], 5_u32.to_le_bytes());
    let second = &bytes[32 + 105..];
    assert_eq!(second[..4], 3_u32.to_le_bytes());
    assert_eq!(second[8..16], (1.0_f64 / 3.0).to_le_bytes());
    let camera = &bytes[28 + 4 + 5 * 105..];
    assert_eq!(&camera[..4], b"CAME");
    assert_eq!(camera[4..12], (48 + 5 * 8_u64).to_le_bytes());
    assert_eq!(camera[12..16], 320_u32.to_le_bytes());
    assert_eq!(camera[20..28], 368.8_f64.to_le_bytes());
    assert_eq!(camera[52..56], 1_u32.to_le_bytes());
    assert_eq!(camera[60..68], (-0.28_f64).to_le_bytes());
    let keyframes = &camera[12 + 88..];
    assert_eq!(&keyframes[..4], b"KEYF");
    assert_eq!(keyframes[4..12], (4 + 3 * 192_u64).to_le_bytes());
    let rotation = map.keyframes[0].world_from_camera.rotation;
    assert_eq!(keyframes[24..32], rotation[(0, 1)].to_le_bytes());
    let errors = &keyframes[12 + 4 + 3 * 192..];
    assert_eq!(&errors[..4], b"ERRS");
    assert_eq!(errors[4..12], (4 + 2 * 4 + 3 * 72_u64).to_le_bytes());
    assert_eq!(errors[20..24], 2_u32.to_le_bytes());
    // The last of the three blocks, its second number.
    let block = &errors[24 + 2 * 72..];
    assert_eq!(block[8..16], 1e-5_f64.to_le_bytes());
    let anchored = &errors[12 + 4 + 2 * 4 + 3 * 72..];
    assert_eq!(&anchored[..4], b"ANCH");
    assert_eq!(anchored[4..12], (4 + 4 * 268_u64).to_le_bytes());
    assert_eq!(anchored.len(), 12 + 4 + 4 * 268 + 4);
}

#[test]
fn every_truncation_and_every_flipped_byte_of_a_map_is_noticed() {
    let bytes = encode_map(&landmarks()[..2], Some(&known(radtan())));
    for length in 0..bytes.len() {
        assert!(decoded(&bytes[..length]).is_err(), "cut to {length} bytes");
    }
    for position in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 0x10;
        assert!(decoded(&damaged).is_err(), "byte {position} flipped");
    }
    let mut longer = bytes;
    longer.extend_from_slice(&[0; 7]);
    assert!(decoded(&longer).is_err());
}

/// A file whose checksum was made to fit is still not believed: no byte makes the reader panic, or allocate what it does
/// not have.
#[test]
fn damage_behind_a_right_checksum_never_panics() {
    let bytes = encode_map(&landmarks()[..2], Some(&known(radtan())));
    for position in 8..bytes.len() - 4 {
        for value in [0, 1, 0x7f, 0x80, 0xff] {
            let damaged = changed(&bytes, |content| content[position] = value);
            // Many changes of a number are another number; the others are faults.
            drop(decoded(&damaged));
        }
    }
    for length in 16..bytes.len() - 4 {
        let cut = changed(&bytes, |content| content.truncate(length));
        assert!(decoded(&cut).is_err(), "cut to {length} bytes");
    }
}

/// Writers of a later minor version add sections, and this reader passes over them.
#[test]
fn unknown_sections_are_passed_over_and_a_newer_major_version_is_refused() {
    let known = known(radtan());
    let parts = |extra: &[([u8; 4], Vec<u8>)]| {
        let mut parts = vec![
            (*b"NEWS", vec![1, 2, 3]),
            (LANDMARKS, sections::landmarks(&landmarks(), Some(&known))),
            (CAMERA, sections::camera(&known.camera)),
            (ANCHORED, sections::anchored(&known.landmarks)),
            (ERRORS, sections::errors(&known.errors)),
            (KEYFRAMES, sections::keyframes(&known.keyframes)),
        ];
        parts.extend_from_slice(extra);
        parts
    };
    let newer = decoded(&encode_sections(2, 7, &parts(&[(*b"MORE", Vec::new())]))).unwrap();
    assert_eq!(newer.known.as_ref(), Some(&known));
    assert_eq!(newer.landmarks, landmarks());
    assert_eq!(
        message(&encode_sections(3, 0, &parts(&[]))),
        "map.slam: expected map format version 2 or older, found version 3.0"
    );
    assert_eq!(
        message(&encode_sections(2, 0, &parts(&[(*b"NEWS", Vec::new())]))),
        "map.slam: expected section \"NEWS\" once, found a second one"
    );
    assert_eq!(
        message(&encode_sections(2, 0, &parts(&[])[..3])),
        "map.slam: expected sections CAME, KEYF, ERRS and ANCH together, found some of them alone"
    );
    assert_eq!(
        message(&encode_sections(2, 0, &parts(&[])[..1])),
        "map.slam: expected section LAND, found none"
    );
}

/// A file of version 1: header with a count, then the landmarks with their own descriptors.
fn version_1(landmarks: &[MapLandmark]) -> Vec<u8> {
    let mut bytes = b"MONOSLAM\x01\0\0\0".to_vec();
    bytes.extend_from_slice(&sections::landmarks(landmarks, None));
    bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

#[test]
fn landmarks_of_version_1_are_read_and_no_run_begins_there() {
    let folder = std::env::temp_dir().join(format!("slam-io-map-v1-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("map.slam");
    std::fs::write(&path, version_1(&landmarks())).unwrap();
    assert_eq!(read_map(&path).unwrap(), landmarks());
    let refused = read_known_map(&path).unwrap_err().to_string();
    assert!(
        refused.ends_with(
            "map.slam: expected a map with camera and keyframes, found one with landmarks alone; run the sequence again \
             to write it with them"
        ),
        "{refused}"
    );
    write_map(&path, &[], Some(&known(radtan()))).unwrap();
    assert_eq!(read_known_map(&path).unwrap(), known(radtan()));
    std::fs::remove_dir_all(&folder).unwrap();
}

/// A device that never ends is refused by its first bytes.
#[cfg(unix)]
#[test]
fn a_device_without_end_is_no_map() {
    let refused = read_map(Path::new("/dev/zero")).unwrap_err().to_string();
    assert_eq!(
        refused,
        "/dev/zero: expected a map starting with MONOSLAM, found other bytes"
    );
}

#[test]
fn faults_of_a_map_are_one_sentence() {
    assert_eq!(
        message(b"hello"),
        "map.slam: expected a map starting with MONOSLAM, found 5 bytes"
    );
    assert_eq!(
        message(b"MONOSLAM\x02\0"),
        "map.slam: expected a map of at least 20 bytes, found 10 bytes"
    );
    assert_eq!(
        message(&[0; 64]),
        "map.slam: expected a map starting with MONOSLAM, found other bytes"
    );
    let damaged = encode_map(&landmarks(), None);
    let mut damaged = damaged;
    damaged[40] ^= 1;
    let refused = message(&damaged);
    assert!(
        refused.ends_with("the file is damaged or cut short"),
        "{refused}"
    );
}

/// Impossible numbers behind a right checksum, each with its sentence.
#[test]
fn impossible_numbers_of_a_map_are_refused() {
    let refused = |landmarks: &[MapLandmark], change: &dyn Fn(&mut KnownMap)| {
        let mut map = known(radtan());
        change(&mut map);
        message(&encode_map(landmarks, Some(&map)))
    };
    assert_eq!(
        refused(&[], &|map| map.landmarks[2].anchor = 3),
        "map.slam: expected anchors among 3 keyframes, found keyframe 3 at landmark 12"
    );
    assert_eq!(
        refused(&[], &|map| map.landmarks.swap(0, 1)),
        "map.slam: expected landmarks in ascending order of id, found 0 after 6"
    );
    assert_eq!(
        refused(&[], &|map| map.landmarks[3].id = 12),
        "map.slam: expected landmarks in ascending order of id, found 12 after 12"
    );
    assert_eq!(
        refused(&[], &|map| map.landmarks[1].parameters.z = f64::NAN),
        "map.slam: expected a finite number as anchored landmark 6, found NaN"
    );
    // An axis of negative variance has no deviation to be scaled with.
    let negative = refused(&[], &|map| map.keyframes[1].covariance[(0, 0)] = -1e-4);
    assert!(
        negative.contains("covariance of keyframe 1, found one with the eigenvalue -1.0"),
        "{negative}"
    );
    let asymmetric = refused(&[], &|map| map.landmarks[0].covariance[(0, 1)] = 9e-5);
    assert!(
        asymmetric
            .contains("covariance of anchored landmark 0, found one that is not symmetric by"),
        "{asymmetric}"
    );
    let correlated = refused(&[], &|map| {
        map.landmarks[0].covariance[(0, 1)] = 2e-4;
        map.landmarks[0].covariance[(1, 0)] = 2e-4;
    });
    assert!(
        correlated.contains("found one with the eigenvalue -4"),
        "{correlated}"
    );
    let sheared = refused(&[], &|map| {
        let mut matrix = *map.keyframes[0].world_from_camera.rotation.matrix();
        matrix[(0, 0)] += 1e-3;
        map.keyframes[0].world_from_camera.rotation = Rotation3::from_matrix_unchecked(matrix);
    });
    assert!(
        sheared.contains("expected a rotation of keyframe 0, found a matrix that misses one by"),
        "{sheared}"
    );
    assert_eq!(
        refused(&[], &|map| map.errors.keyframes[1] = 3),
        "map.slam: expected errors of at most 256 of 3 keyframes in their order, found 2 that are not"
    );
    // What the two errors have in common is more than either of them is.
    assert_eq!(
        refused(&[], &|map| map.errors.rows[1][0] =
            Matrix3::identity() * 1e-4),
        "map.slam: expected a positive semi-definite covariance of the errors of the keyframes, found one with a negative \
         variance"
    );
    let mut far = landmarks();
    far[1].position.x = f64::INFINITY;
    assert_eq!(
        refused(&far, &|_| {}),
        "map.slam: expected a finite number as landmark 3, found inf"
    );
    let greedy = changed(&encode_map(&landmarks(), None), |content| {
        content[28..32].copy_from_slice(&u32::MAX.to_le_bytes());
    });
    assert_eq!(
        message(&greedy),
        "map.slam: expected 4294967295 landmarks, found 909 bytes left for them"
    );
    let long = changed(&encode_map(&landmarks(), None), |content| {
        content[20..28].copy_from_slice(&u64::MAX.to_le_bytes());
    });
    assert_eq!(
        message(&long),
        "map.slam: expected 18446744073709551615 bytes of section \"LAND\", found 913 left in the file"
    );
}
