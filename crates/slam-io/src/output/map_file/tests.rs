//! A map reads back bit for bit, and every kind of damage is noticed.

use super::*;

fn landmarks() -> Vec<MapLandmark> {
    (0..5_u32)
        .map(|id| MapLandmark {
            id: 3 * id,
            position: Vector3::new(f64::from(id) / 3.0, 2.0, 0.1),
            covariance: Matrix3::identity() * (1e-4 * f64::from(1 + id * id * id)),
            observations: 2 + id,
            descriptor: (id % 2 == 0)
                .then(|| Box::new(std::array::from_fn(|index| (index as u32 * (id + 1)) as u8))),
        })
        .collect()
}

/// The checksum is the last four bytes: the CRC-32 of IEEE 802.3, whose check value is public.
#[test]
fn val_the_checksum_is_crc_32() {
    assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
    let bytes = encode_map(&landmarks());
    let (content, checksum) = bytes.split_last_chunk::<4>().unwrap();
    assert_eq!(u32::from_le_bytes(*checksum), crc32fast::hash(content));
}

#[test]
fn the_map_reads_back_bit_for_bit() {
    let landmarks = landmarks();
    let bytes = encode_map(&landmarks);
    assert_eq!(
        decode_map(Path::new("map.slam"), &bytes).unwrap(),
        landmarks
    );
    assert_eq!(
        decode_map(Path::new("map.slam"), &encode_map(&[])).unwrap(),
        []
    );
}

#[test]
fn every_truncation_and_every_flipped_byte_of_a_map_is_noticed() {
    let bytes = encode_map(&landmarks()[..2]);
    let path = Path::new("map.slam");
    for length in 0..bytes.len() {
        assert!(
            decode_map(path, &bytes[..length]).is_err(),
            "cut to {length} bytes"
        );
    }
    for position in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 0x10;
        assert!(
            decode_map(path, &damaged).is_err(),
            "byte {position} flipped"
        );
    }
    let mut longer = bytes;
    longer.extend_from_slice(&[0; 7]);
    assert!(decode_map(path, &longer).is_err());
}

#[test]
fn faults_of_a_map_are_one_sentence() {
    let message = |bytes: &[u8]| {
        decode_map(Path::new("map.slam"), bytes)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(b"hello"),
        "map.slam: expected a map of at least 20 bytes, found 5 bytes"
    );
    assert_eq!(
        message(&[0; 64]),
        "map.slam: expected a map starting with MONOSLAM, found other bytes"
    );
    let mut newer = encode_map(&[]);
    newer[8] = 2;
    assert_eq!(
        message(&newer),
        "map.slam: expected map format version 1, found 2"
    );
    let mut greedy = encode_map(&[]);
    greedy[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(
        message(&greedy),
        "map.slam: expected 4294967295 landmarks, found a file cut short after 20 bytes"
    );
}
