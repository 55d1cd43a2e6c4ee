"""Shows that the portable kernels give the bits of x86-64 on aarch64, where they are compiled to NEON.

    python3 xtask/scripts/neon_bits.py [--target-dir DIR] [--no-tests]

Needs the compiler's library for the other processor (`rustup target add aarch64-unknown-linux-gnu`), a linker for it
(`gcc-aarch64-linux-gnu`) and `qemu-aarch64` (`qemu-user`; Debian's names). The example `bits` of vision-sift and of
feature-kdtree prints a number for all bits of its results at every level of vector instructions; the script runs both
examples on this processor and under qemu, and compares. Then it runs the tests of simd-level, vision-sift and
feature-kdtree under qemu. Exit code 1 when anything differs or fails.
"""

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TARGET = "aarch64-unknown-linux-gnu"
CRATES = ["vision-sift", "feature-kdtree"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target-dir", default=os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target")))
    parser.add_argument("--no-tests", action="store_true", help="compare the bits only")
    options = parser.parse_args()
    for tool, package in [("qemu-aarch64", "qemu-user"), ("aarch64-linux-gnu-gcc", "gcc-aarch64-linux-gnu")]:
        if not shutil.which(tool):
            sys.exit(f"{tool} is missing (Debian: {package})")
    env = dict(os.environ, CARGO_TARGET_DIR=options.target_dir,
               CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER="aarch64-linux-gnu-gcc",
               CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu")
    found = []
    for crate in CRATES:
        for more in [[], ["--target", TARGET]]:
            command = ["cargo", "run", "--quiet", "--package", crate, "--example", "bits", *more]
            told = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
            if told.returncode:
                sys.exit(told.stderr)
            processor = "aarch64" if more else "this processor"
            for line in told.stdout.splitlines():
                name, level, count, bits = line.split()
                found.append((name, processor, level, count, bits))
    print(f"{'crate':<16}{'on':<16}{'level':<10}{'results':>8}  bits")
    for name, processor, level, count, bits in found:
        print(f"{name:<16}{processor:<16}{level:<10}{count:>8}  {bits}")
    differ = [name for name in CRATES if len({row[3:] for row in found if row[0] == name}) != 1]
    print(f"different bits: {', '.join(differ)}" if differ else "all bits are equal")
    failed = bool(differ)
    if not options.no_tests:
        packages = [word for crate in ["simd-level", *CRATES] for word in ("--package", crate)]
        tests = subprocess.run(["cargo", "test", "--no-fail-fast", "--lib", "--tests", *packages, "--target", TARGET], cwd=ROOT, env=env)
        failed |= tests.returncode != 0
    sys.exit(failed)


if __name__ == "__main__":
    main()
