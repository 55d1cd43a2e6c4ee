"""Errors of runs without odometry: `mono-slam run SEQ --odometry none` for seeds 1 to N on every sequence given.

Run: python3 without_odometry.py PROGRAM SCRATCH N SEQ [SEQ ...], with PROGRAM the mono-slam binary and SCRATCH a folder for
the results. Options of the run, such as --robot car, go after the sequence, joined by commas: SEQ,--robot,car.
Prints one line a sequence: root mean square position errors after alignment with scale (median and largest over the seeds)
of the filtered and the smoothed path, of the wheels alone where the sequence has odometry (aligned the same way), and the
length of the reference path.
"""
import json
import math
import os
import statistics
import subprocess
import sys


def run(program, sequence, out, options):
    command = [program, "run", sequence, "--out", out, "--quiet", *options]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    with open(os.path.join(out, "summary.json")) as file:
        return json.load(file)


def length(out):
    with open(os.path.join(out, "report_data.json")) as file:
        poses = [entry[1] for entry in json.load(file)["reference"] or []]
    xy = [(p["x"], p["y"]) if isinstance(p, dict) else (p[0], p[1]) for p in poses]
    return sum(math.dist(a, b) for a, b in zip(xy, xy[1:]))


def main():
    program, scratch, seeds = sys.argv[1], sys.argv[2], int(sys.argv[3])
    for argument in sys.argv[4:]:
        sequence, *options = argument.split(",")
        name = os.path.basename(sequence.rstrip("/"))
        out = os.path.join(scratch, name)
        errors = {"filtered": [], "smoothed": []}
        for seed in range(1, seeds + 1):
            summary = run(program, sequence, out, ["--odometry", "none", "--seed", str(seed), *options])
            for path, found in errors.items():
                aligned = summary["figures"]["errors"].get(path, {}).get("sim2")
                found.append(1e3 * aligned["position_m"]["rmse"] if aligned else math.inf)
        row = [f"{path} {statistics.median(e):.1f} (largest {max(e):.1f}) mm" for path, e in errors.items()]
        print(f"{name}: {seeds} seeds, {'; '.join(row)}; reference {length(out):.2f} m", flush=True)


if __name__ == "__main__":
    main()
