"""Laps of rendered rooms with everything that can happen to a robot on the way, each run once, and a table of what came of it.

A second lap shows whether old places are found again: its error against that of the first, and how many landmarks it adds.
Twin posters tempt to a false revisit; robots are carried, blinded, covered, and somebody walks by. The last column counts
frames whose true position lies within three standard deviations (chi-square 11.83 of two degrees of freedom).

    python3 xtask/scripts/old_places.py RENDERER PROGRAM FOLDER [--seeds 3]

RENDERER is the binary wall-scenes, PROGRAM the binary mono-slam (both of a release build); sequences and results go to FOLDER
and are used again when they are there.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess

SCENES = [
    ("two laps", 400, []),
    ("twin posters", 410, ["--twin-posters"]),
    ("carried 1.5 m", 420, ["--kidnap", "250:1.5"]),
    ("dark for 3 s", 430, ["--dark", "240:246"]),
    ("covered for 5 s", 440, ["--blocked", "100:110"]),
    ("a walker", 450, ["--walker"]),
    ("motion blur", 460, ["--shutter", "0.03"]),
]


def row(sequence, result):
    """Figures of one run."""
    truth = list(csv.DictReader(open(sequence / "groundtruth_planar.csv")))
    frames = list(csv.DictReader(open(result / "frames.csv")))
    covariance = list(csv.DictReader(open(result / "covariance.csv")))
    path = [line.split() for line in open(result / "trajectory.tum") if not line.startswith("#")]
    squared, inside = [], 0
    for t, p, c in zip(truth, path, covariance):
        dx, dy = float(p[1]) - float(t["x_m"]), float(p[2]) - float(t["y_m"])
        squared.append(dx * dx + dy * dy)
        xx, xy, yy = float(c["xx"]), float(c["xy"]), float(c["yy"])
        determinant = xx * yy - xy * xy
        inside += determinant <= 0 or (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant < 11.83
    half = len(squared) // 2
    rmse = [1e3 * math.sqrt(sum(s) / len(s)) for s in (squared[:half], squared[half:])]
    states = [f["state"] for f in frames]
    figures = json.load(open(result / "summary.json"))["figures"]["errors"]["smoothed"]["none"]["position_m"]
    return {
        "first": rmse[0],
        "second": rmse[1],
        "smoothed": 1e3 * figures["rmse"],
        "landmarks": int(frames[-1]["landmarks"]) / int(frames[half]["landmarks"]),
        "lost": states.count("lost"),
        "found": states.count("relocalised"),
        "revisits": sum(int(f["revisit"]) for f in frames),
        "inside": 100.0 * inside / len(squared),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("renderer")
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    print("| scene | RMSE of lap 1, mm | of lap 2, mm | smoothed, mm | landmarks after lap 2 | lost frames | found | revisits | within 3 sigma, % |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name, first_seed, options in SCENES:
        rows = []
        for seed in range(first_seed + 1, first_seed + 1 + arguments.seeds):
            sequence = arguments.folder / f"room{seed}"
            if not sequence.exists():
                subprocess.run(
                    [arguments.renderer, "scene", "--out", sequence, "--kind", "room", "--seed", str(seed), "--laps", "2", *options],
                    check=True, capture_output=True)
            result = arguments.folder / f"room{seed}.out"
            subprocess.run([arguments.program, "run", sequence, "--out", result, "--quiet"], check=True, capture_output=True)
            rows.append(row(sequence, result))
        mean = {key: sum(r[key] for r in rows) / len(rows) for key in rows[0]}
        print(f"| {name} | {mean['first']:.1f} | {mean['second']:.1f} | {mean['smoothed']:.1f} | {mean['landmarks']:.2f} x | "
              f"{mean['lost']:.1f} | {mean['found']:.1f} | {mean['revisits']:.1f} | {mean['inside']:.1f} |", flush=True)


if __name__ == "__main__":
    main()
