"""Kills runs that write checkpoints, at random moments, and shows that they end in the bytes of a run left alone.

    python3 xtask/scripts/kill_and_resume.py MONO_SLAM SEQUENCE --work FOLDER [--kills 50] [--seed 1] [--every 3] [--particles 30]

MONO_SLAM is the program, SEQUENCE any folder it runs. One run is left alone; it also tells how long a run takes. Then runs
with `--checkpoint-every EVERY` are started and killed (SIGKILL) after a random part of that time, and started
again with `--resume`, until one ends by itself; then the next one begins, until KILLS processes have been killed. After every
run that ended its results are compared with those of the first: the files below byte by byte, `frames.csv` without its
columns of milliseconds, `summary.json` without `wall_s` and the figures made of it. The table has one row a run. The
exit code is 1 when anything differed.
"""

import argparse
import csv
import json
import random
import subprocess
import sys
import time
from pathlib import Path

TIMELESS = [
    "trajectory.tum",
    "trajectory_smoothed.tum",
    "covariance.csv",
    "map.slam",
    "map.ply",
    "tracks.csv",
    "camera.toml",
    "odometry.csv",
]
# Figures of wall time in summary.json.
TIMED = ("wall_s", "_ms", "frames_per_s")


def frames(folder):
    """Rows of frames.csv without milliseconds."""
    with open(folder / "frames.csv", newline="") as table:
        return [{k: v for k, v in row.items() if not k.endswith("_ms")} for row in csv.DictReader(table)]


def without_times(value):
    """A JSON value without the figures of wall time."""
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if not k.endswith(TIMED)}
    if isinstance(value, list):
        return [without_times(v) for v in value]
    return value


def differences(one, other):
    """Names of the results that differ."""
    found = [name for name in TIMELESS if (one / name).read_bytes() != (other / name).read_bytes()]
    if frames(one) != frames(other):
        found.append("frames.csv")
    summaries = [without_times(json.loads((folder / "summary.json").read_text())) for folder in (one, other)]
    if summaries[0] != summaries[1]:
        found.append("summary.json")
    return found


def main():
    """Runs, kills, compares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("sequence")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=int, default=3)
    parser.add_argument("--particles", type=int, default=30)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    base = [arguments.program, "run", arguments.sequence, "--quiet", "--particles", str(arguments.particles)]
    arguments.work.mkdir(parents=True, exist_ok=True)
    whole = arguments.work / "whole"
    started = time.monotonic()
    subprocess.run([*base, "--out", str(whole)], check=True)
    length = time.monotonic() - started
    print(f"a run left alone takes {length:.1f} s")
    print(f"{'run':>4} {'kills':>6} {'resumed after frames':<40} differing results")
    killed, run, bad = 0, 0, 0
    while killed < arguments.kills:
        run += 1
        out = arguments.work / f"run{run:02}"
        kills, resumed = 0, []
        while True:
            command = [*base, "--out", str(out), "--checkpoint-every", str(arguments.every), "--resume"]
            child = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
            # The last ones are left to end.
            patience = rng.uniform(0.05, 0.8) * length if killed < arguments.kills else None
            try:
                _, told = child.communicate(timeout=patience)
                ended = True
            except subprocess.TimeoutExpired:
                child.kill()
                _, told = child.communicate()
                killed += 1
                kills += 1
                ended = False
            for line in told.splitlines():
                if "going on after" in line:
                    resumed.append(line.split("going on after ")[1].split()[0])
                elif "begins at its first frame" not in line and "warning" not in line:
                    print(f"     {line}")
            if ended:
                break
        found = differences(whole, out) if child.returncode == 0 else [f"exit code {child.returncode}"]
        # Half checkpoints of killed processes go with the checkpoint.
        left = [path.name for path in arguments.work.glob(f"{out.name}*") if path != out]
        found += [f"left behind: {name}" for name in left]
        bad += bool(found)
        print(f"{run:>4} {kills:>6} {' '.join(resumed):<40} {', '.join(found) or 'none'}")
    print(f"{killed} processes killed in {run} runs; {bad} runs ended in other results")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
