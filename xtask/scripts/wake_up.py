"""Robots that wake up somewhere in a rendered room that an earlier lap has mapped, and a table of how soon and how well they
find themselves.

Each room is driven twice around. The first lap makes the map; from many frames of the second lap on, `mono-slam localize`
starts without any knowledge of the pose. A run is found at the first frame that is not lost. The error is that of the frames
after it, against the truth in the world of the map; a frame counts as inside when its true position lies within three standard
deviations (chi-square 11.83 of two degrees of freedom), and NEES of three degrees of freedom is the mean over x, y and heading
divided by three (1 is right; the frames of a run share the error of the map and are not independent).

    python3 xtask/scripts/wake_up.py RENDERER PROGRAM FOLDER [--seeds 3] [--first-seed 500] [--starts 12] [--frames 25]

RENDERER is the binary wall-scenes, PROGRAM the binary mono-slam (both of a release build); sequences and results go to FOLDER
and are used again when they are there.
"""

import argparse
import csv
import math
import pathlib
import shutil
import subprocess

LAP = 178


def cut(whole, first, last, part):
    """The frames `first` to `last` (left out) of the sequence `whole` as the sequence `part`."""
    if (part / "times.txt").exists():
        return
    (part / "images").mkdir(parents=True, exist_ok=True)
    lines = (whole / "times.txt").read_text().splitlines()
    times = [line for line in lines if line and not line.startswith("#")][first:last]
    images = sorted((whole / "images").iterdir())[first:last]
    for image in images:
        (part / "images" / image.name).symlink_to(image.resolve())
    start, end = (float(t.split()[-1]) for t in (times[0], times[-1]))
    rows = (whole / "odometry.csv").read_text().splitlines()
    kept = [r for r in rows[1:] if start - 1e-9 <= float(r.split(",")[0]) <= end + 1e-9]
    (part / "odometry.csv").write_text("\n".join([rows[0], *kept]) + "\n")
    shutil.copy(whole / "camera.toml", part / "camera.toml")
    (part / "times.txt").write_text("\n".join(times) + "\n")


def inverse(m):
    """Inverse of a symmetric 3x3 matrix."""
    (a, b, c), (_, d, e), (_, _, f) = m
    co = [[d * f - e * e, c * e - b * f, b * e - c * d], [0, a * f - c * c, b * c - a * e], [0, 0, a * d - b * b]]
    det = a * co[0][0] + b * co[0][1] + c * co[0][2]
    full = [[co[min(i, j)][max(i, j)] / det for j in range(3)] for i in range(3)]
    return full


def run(program, sequence, truth, offset, known, result):
    """First frame that is found, and errors of the frames from there on."""
    if not (result / "frames.csv").exists():
        subprocess.run([program, "localize", sequence, "--map", known, "--out", result, "--quiet"], check=True,
                       stderr=subprocess.DEVNULL)
    states = [f["state"] for f in csv.DictReader(open(result / "frames.csv"))]
    found = next((i for i, s in enumerate(states) if s != "lost"), None)
    if found is None:
        return None, []
    path = [line.split() for line in open(result / "trajectory.tum") if not line.startswith("#")]
    frames = []
    for i, (p, c) in enumerate(zip(path, csv.DictReader(open(result / "covariance.csv")))):
        if i < found or states[i] == "lost":
            continue
        t = truth[offset + i]
        phi = 2.0 * math.atan2(float(p[6]), float(p[7]))
        e = [float(p[1]) - float(t["x_m"]), float(p[2]) - float(t["y_m"]), phi - float(t["phi_rad"])]
        e[2] = math.atan2(math.sin(e[2]), math.cos(e[2]))
        names = [["xx", "xy", "xphi"], ["xy", "yy", "yphi"], ["xphi", "yphi", "phiphi"]]
        m = [[float(c[n]) for n in row] for row in names]
        w = inverse(m)
        nees = sum(e[a] * w[a][b] * e[b] for a in range(3) for b in range(3)) / 3.0
        d = m[0][0] * m[1][1] - m[0][1] ** 2
        two = (m[1][1] * e[0] ** 2 - 2 * m[0][1] * e[0] * e[1] + m[0][0] * e[1] ** 2) / d
        frames.append((math.hypot(e[0], e[1]), nees, two < 11.83))
    return found, frames


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("renderer")
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=500)
    parser.add_argument("--starts", type=int, default=12)
    parser.add_argument("--frames", type=int, default=25)
    arguments = parser.parse_args()
    print("| room seed | starts | found within 5 frames | never | frames until found, largest | RMSE, mm | largest error, mm "
          "| NEES / 3 | inside, % |")
    print("|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
        whole = arguments.folder / f"room{seed}"
        if not (whole / "groundtruth_planar.csv").exists():
            subprocess.run([arguments.renderer, "scene", "--kind", "room", "--laps", "2", "--seed", str(seed), "--out", whole],
                           check=True)
        truth = list(csv.DictReader(open(whole / "groundtruth_planar.csv")))
        first = arguments.folder / f"room{seed}_lap1"
        cut(whole, 0, LAP, first)
        known = arguments.folder / f"room{seed}_map" / "map.slam"
        if not known.exists():
            subprocess.run([arguments.program, "run", first, "--out", known.parent, "--quiet"], check=True,
                           stderr=subprocess.DEVNULL)
        soon, never, longest, everything = 0, 0, 0, []
        for k in range(arguments.starts):
            offset = LAP + k * (len(truth) - LAP - arguments.frames) // max(arguments.starts - 1, 1)
            part = arguments.folder / f"room{seed}_from{offset}"
            cut(whole, offset, offset + arguments.frames, part)
            found, frames = run(arguments.program, part, truth, offset, known, arguments.folder / f"room{seed}_out{offset}")
            never += found is None
            soon += found is not None and found < 5
            longest = max(longest, found or 0)
            everything += frames
        n = max(len(everything), 1)
        print(f"| {seed} | {arguments.starts} | {soon} | {never} | {longest} "
              f"| {1e3 * math.sqrt(sum(f[0] ** 2 for f in everything) / n):.1f} | {1e3 * max((f[0] for f in everything), default=0):.0f} "
              f"| {sum(f[1] for f in everything) / n:.2f} | {100 * sum(f[2] for f in everything) / n:.1f} |", flush=True)


if __name__ == "__main__":
    main()
