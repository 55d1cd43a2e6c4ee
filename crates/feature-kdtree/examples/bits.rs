//! One number for all answers of the indexes to some drawn queries: equal numbers mean equal answers.
//!
//! `cargo run -p feature-kdtree --example bits` prints a line for every level of vector instructions of this processor;
//! `xtask/scripts/neon_bits.py` compares those of x86-64 and aarch64.

use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, Hamming, IndexError, InvertedLists,
    InvertedListsParams, LinearScan, SimdLevel, SquaredEuclidean,
};

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), IndexError> {
    let mut draw = Draws(1);
    let entries: Vec<Descriptor> = (0..3000).map(|_| draw.bytes()).collect();
    let queries: Vec<Descriptor> = (0..60)
        .map(|i| {
            let mut seen = entries[37 * i];
            seen[i] = seen[i].wrapping_add(9);
            seen
        })
        .collect();
    for level in SimdLevel::available() {
        let mut scan = ExactScan::with_level(level);
        let mut lists = InvertedLists::with_level(InvertedListsParams::default(), level)?;
        let mut floats = LinearScan::<[f32; 128], SquaredEuclidean>::with_level(level);
        let mut binary = LinearScan::<Descriptor, Hamming>::with_level(level);
        for (id, entry) in (0..).zip(&entries) {
            scan.insert(id, entry)?;
            lists.insert(id, entry)?;
            floats.insert(id, &as_floats(entry))?;
            binary.insert(id, entry)?;
        }
        let (mut bits, mut count) = (Hash(0xcbf2_9ce4_8422_2325), 0_u32);
        for query in &queries {
            for index in [&scan as &dyn DescriptorIndex, &lists] {
                for found in index.nearest(query, 5) {
                    bits.add(found.id, found.distance_squared);
                    count += 1;
                }
            }
            for found in floats.nearest(&as_floats(query), 5)? {
                bits.add(found.id, found.distance.to_bits());
                count += 1;
            }
            for found in binary.nearest(query, 5)? {
                bits.add(found.id, found.distance);
                count += 1;
            }
        }
        println!("feature-kdtree {level} {count} {:016x}", bits.0);
    }
    Ok(())
}

/// Floats whose sums round.
fn as_floats(descriptor: &Descriptor) -> [f32; 128] {
    descriptor.map(|value| f32::from(value) / 77.0)
}

/// A linear congruential generator.
struct Draws(u64);

impl Draws {
    fn bytes(&mut self) -> Descriptor {
        std::array::from_fn(|_| {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as u8
        })
    }
}

/// FNV-1a over words.
struct Hash(u64);

impl Hash {
    fn add(&mut self, id: u32, distance: u32) {
        for word in [id, distance] {
            self.0 = (self.0 ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
