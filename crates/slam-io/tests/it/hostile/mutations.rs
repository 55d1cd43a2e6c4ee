//! Bytes that nobody meant: genuine files that were flipped, cut, spliced, repeated, given huge numbers and lengths, and bytes
//! at random. A parser answers them with a value or an error, and with memory in proportion to them.
//!
//! The tests of other crates include this file by its path.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::Instant;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Cases a parser where `MONO_SLAM_CASES` does not say.
const CASES: u32 = 200;
/// Most bytes at random.
const RANDOM_BYTES: usize = 400;
/// Most changes of a genuine file.
const CHANGES: usize = 6;
/// Longest piece that is copied or taken away.
const PIECE: usize = 200;
/// Bytes beyond which a repeated piece is repeated no more.
const MOST_BYTES: usize = 1 << 20;

/// Words in place of a number of a text.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "99999999999999999999999999999999",
    "0x10",
    "1_000",
    "--5",
    "",
];
/// Lengths that no file has, and some that are nearly right.
const LENGTHS: [u64; 10] = [
    0,
    1,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    1 << 33,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];

/// A change of a file.
#[derive(Debug, Clone)]
enum Change {
    Flip(Index, u8),
    Cut(Index),
    Insert(Index, Vec<u8>),
    Remove(Index, usize),
    Copy(Index, Index, usize),
    Repeat(Index, usize, usize),
    /// A number of the text, counted from a place, becomes another.
    Number(Index, &'static str),
    /// Bytes of a length: 1, 2, 4 or 8 of them, either end first.
    Length(Index, u64, usize, bool),
}

/// A file: one of the genuine ones with changes, or bytes behind the beginning of one.
#[derive(Debug, Clone)]
enum Made {
    Changed(Index, Vec<Change>),
    Random(Index, usize, Vec<u8>),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<Index>;
    prop_oneof![
        (at(), 1..=255_u8).prop_map(|(at, bits)| Change::Flip(at, bits)),
        at().prop_map(Change::Cut),
        (at(), vec(any::<u8>(), 1..20)).prop_map(|(at, bytes)| Change::Insert(at, bytes)),
        (at(), 1..PIECE).prop_map(|(at, length)| Change::Remove(at, length)),
        (at(), at(), 1..PIECE).prop_map(|(from, to, length)| Change::Copy(from, to, length)),
        (at(), 1..PIECE, 1..300_usize)
            .prop_map(|(at, length, times)| Change::Repeat(at, length, times)),
        (at(), select(&NUMBERS[..])).prop_map(|(at, number)| Change::Number(at, number)),
        (
            at(),
            select(&LENGTHS[..]),
            select(&[1, 2, 4, 8][..]),
            any::<bool>()
        )
            .prop_map(|(at, length, bytes, big)| Change::Length(at, length, bytes, big)),
    ]
}

fn made() -> impl Strategy<Value = Made> {
    prop_oneof![
        9 => (any::<Index>(), vec(change(), 1..=CHANGES))
            .prop_map(|(file, changes)| Made::Changed(file, changes)),
        1 => (any::<Index>(), 0..20_usize, vec(any::<u8>(), 0..RANDOM_BYTES))
            .prop_map(|(file, kept, bytes)| Made::Random(file, kept, bytes)),
    ]
}

impl Change {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let count = bytes.len();
        let piece = |at: usize, length: usize| at..count.min(at + length);
        match self {
            Change::Flip(at, bits) => bytes[at.index(count)] ^= bits,
            Change::Cut(at) => bytes.truncate(at.index(count)),
            Change::Insert(at, more) => {
                let at = at.index(count);
                bytes.splice(at..at, more.iter().copied());
            }
            Change::Remove(at, length) => drop(bytes.drain(piece(at.index(count), *length))),
            Change::Copy(from, to, length) => {
                let copied = bytes[piece(from.index(count), *length)].to_vec();
                let to = to.index(count);
                bytes.splice(to..to, copied);
            }
            Change::Repeat(at, length, times) => {
                let range = piece(at.index(count), *length);
                let copied = bytes[range.clone()].repeat(*times);
                if count + copied.len() < MOST_BYTES {
                    bytes.splice(range.end..range.end, copied);
                }
            }
            Change::Number(at, number) => {
                let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.".contains(byte);
                let from = at.index(count);
                let Some(from) = bytes[from..].iter().position(is_part).map(|k| from + k) else {
                    return;
                };
                let length = bytes[from..]
                    .iter()
                    .take_while(|byte| is_part(byte))
                    .count();
                bytes.splice(from..from + length, number.bytes());
            }
            Change::Length(at, length, size, big) => {
                let range = piece(at.index(count), *size);
                let told = if *big {
                    length.to_be_bytes()[8 - size..].to_vec()
                } else {
                    length.to_le_bytes()[..*size].to_vec()
                };
                for (byte, new) in bytes[range].iter_mut().zip(told) {
                    *byte = new;
                }
            }
        }
    }
}

impl Made {
    fn bytes(&self, genuine: &[Vec<u8>]) -> Vec<u8> {
        match self {
            Made::Changed(file, changes) => {
                let mut bytes = file.get(genuine).clone();
                for change in changes {
                    change.apply(&mut bytes);
                }
                bytes
            }
            Made::Random(file, kept, bytes) => {
                let file = file.get(genuine);
                [&file[..*kept.min(&file.len())], bytes].concat()
            }
        }
    }
}

/// Cases a parser.
fn cases() -> u32 {
    std::env::var("MONO_SLAM_CASES").map_or(CASES, |number| number.parse().unwrap())
}

/// Memory that a parser may hold at a time: so many bytes for a byte of its input, and so many for nothing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Memory {
    pub(crate) per_byte: u64,
    pub(crate) always: u64,
}

/// Lets `parse` loose on changed copies of `genuine` files: it must not panic, and must keep to the memory.
///
/// `seal` puts right what a reader compares first, a checksum; half of the cases are sealed.
pub(crate) fn attack(
    parser: &str,
    genuine: &[Vec<u8>],
    memory: Memory,
    seal: impl Fn(&mut [u8]),
    parse: impl Fn(&[u8]),
) {
    let mut runner = TestRunner::new(Config {
        cases: cases(),
        rng_seed: RngSeed::Fixed(2006),
        failure_persistence: None,
        ..Config::default()
    });
    let started = Instant::now();
    let most = std::cell::Cell::new((0_u64, 0_usize));
    let result = runner.run(&(made(), any::<bool>()), |(made, sealed)| {
        let mut bytes = made.bytes(genuine);
        if sealed {
            seal(&mut bytes);
        }
        // A panic may not leave the measurement, which would never end.
        let mut outcome = Ok(());
        let info = allocation_counter::measure(|| {
            outcome = catch_unwind(AssertUnwindSafe(|| parse(&bytes)));
        });
        if let Err(panic) = outcome {
            resume_unwind(panic);
        }
        let allowed = memory.per_byte * bytes.len() as u64 + memory.always;
        if info.bytes_max > most.get().0 {
            most.set((info.bytes_max, bytes.len()));
        }
        prop_assert!(
            info.bytes_max <= allowed,
            "{} bytes of memory for {} bytes, allowed: {allowed}: {:?}",
            info.bytes_max,
            bytes.len(),
            String::from_utf8_lossy(&bytes[..bytes.len().min(2000)])
        );
        Ok(())
    });
    if let Err(error) = result {
        panic!("{parser}: {error}");
    }
    let (held, of) = most.get();
    println!(
        "{parser}: {} cases in {:.1} s, at most {held} bytes of memory (for {of} bytes)",
        cases(),
        started.elapsed().as_secs_f64()
    );
}
