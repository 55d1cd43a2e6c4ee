//! Prints the levels of vector instructions that this processor has.

use simd_level::SimdLevel;

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() {
    for level in SimdLevel::available() {
        println!("{level}");
    }
    println!("best: {}", SimdLevel::best());
}
