"""How far the filter is from the truth, and whether its covariance says so: `mono-slam run` over sequences with a reference, several seeds each.

    python3 xtask/scripts/evaluate_sequences.py BINARY SEEDS SEQUENCE...
    python3 xtask/scripts/evaluate_sequences.py target/release/mono-slam 6-10 fixtures/wall
    python3 xtask/scripts/evaluate_sequences.py target/release/mono-slam 1-5 kitti06=car wall_1 --jobs 2

A sequence is a folder with groundtruth_planar.csv, one row a frame; FOLDER=PRESET runs it with `--robot PRESET`. Runs go to a temporary folder,
or stay in `--out DIR`. Each run has one thread, so that the processor time is that of the work. `--arguments "..."` are added to each run.

One line a sequence, means over the seeds (the largest value in `max`):

    rmse     RMSE of the position without alignment, mm, with its standard deviation over the seeds
    freed    the same after the turn about the first position that fits best: the first heading of the reference is free
    heading  RMSE of the heading, mrad
    smooth   RMSE of the position of the smoothed path, mm
    band     frames in which the error of (x, y, heading) lies in the 95 % region of the reported covariance, per cent
    nees     squared error over the covariance, mean of all frames: 3 is right, more is overconfident
    seconds  processor time of a run

The first frame is left out of `freed`, `band` and `nees`: its error is zero by definition. Needs Python 3.9 alone.
"""

import argparse
import concurrent.futures
import csv
import json
import math
import os
import pathlib
import shlex
import statistics
import subprocess
import sys
import tempfile

# 95 % of chi-square with three degrees of freedom.
BAND = 7.814728


def seeds(text):
    """Seeds of `4` or `6-10`."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def sequence(text):
    """Folder and preset of `FOLDER` or `FOLDER=PRESET`."""
    folder, _, preset = text.partition("=")
    folder = pathlib.Path(folder)
    if not (folder / "groundtruth_planar.csv").is_file():
        raise argparse.ArgumentTypeError(f"{folder}: expected a sequence with groundtruth_planar.csv")
    return folder, preset


def rows(path):
    with open(path, newline="", encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items() if key != "state"} for row in csv.DictReader(file)]


def trajectory(path):
    """x, y and heading of each line of a TUM file."""
    lines = (line.split() for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    return [(float(p[1]), float(p[2]), 2.0 * math.atan2(float(p[6]), float(p[7]))) for p in lines]


def squared_over(covariance, error):
    """error^T covariance^-1 error by a Cholesky factor; infinite where there is none."""
    factor, solved = [[0.0] * 3 for _ in range(3)], [0.0] * 3
    for i in range(3):
        for j in range(i + 1):
            rest = covariance[i][j] - sum(factor[i][k] * factor[j][k] for k in range(j))
            if i == j:
                if rest <= 0.0:
                    return math.inf
                factor[i][i] = math.sqrt(rest)
            else:
                factor[i][j] = rest / factor[j][j]
        solved[i] = (error[i] - sum(factor[i][k] * solved[k] for k in range(i))) / factor[i][i]
    return sum(value * value for value in solved)


def freed_rmse(path, truth):
    """RMSE in metres after the best turn about the first position; both begin there."""
    x, y = truth[0][:2]
    path = [(p[0] - x, p[1] - y) for p in path[1:]]
    truth = [(p[0] - x, p[1] - y) for p in truth[1:]]
    turn = math.atan2(
        sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(path, truth)),
        sum(p[0] * q[0] + p[1] * q[1] for p, q in zip(path, truth)),
    )
    c, s = math.cos(turn), math.sin(turn)
    squares = [(c * p[0] - s * p[1] - q[0]) ** 2 + (s * p[0] + c * p[1] - q[1]) ** 2 for p, q in zip(path, truth)]
    return math.sqrt(statistics.fmean(squares))


def judged(folder, out):
    """The figures of a finished run."""
    errors = json.loads((out / "summary.json").read_text(encoding="utf-8"))["figures"]["errors"]
    filtered, smoothed = errors["filtered"]["none"], errors["smoothed"]["none"]
    truth = [(row["x_m"], row["y_m"], row["phi_rad"]) for row in rows(folder / "groundtruth_planar.csv")]
    path = trajectory(out / "trajectory.tum")
    nees = []
    for estimate, true, c in list(zip(path, truth, rows(out / "covariance.csv")))[1:]:
        turn = (estimate[2] - true[2] + math.pi) % (2.0 * math.pi) - math.pi
        covariance = [[c["xx"], c["xy"], c["xphi"]], [c["xy"], c["yy"], c["yphi"]], [c["xphi"], c["yphi"], c["phiphi"]]]
        nees.append(squared_over(covariance, [estimate[0] - true[0], estimate[1] - true[1], turn]))
    return {
        "rmse": 1e3 * filtered["position_m"]["rmse"],
        "freed": 1e3 * freed_rmse(path, truth),
        "heading": 1e3 * filtered["heading_rad"]["rmse"],
        "smooth": 1e3 * smoothed["position_m"]["rmse"],
        "band": 100.0 * statistics.fmean(value < BAND for value in nees),
        "nees": statistics.fmean(nees),
    }


def run(options, folder, preset, seed):
    """Runs one seed and judges it."""
    out = pathlib.Path(options.out) / f"{folder.resolve().name}-{seed}"
    command = [options.binary, "run", folder, "--out", out, "--quiet", "--threads", "1", "--seed", str(seed)]
    command += ["--robot", preset] if preset else []
    with tempfile.TemporaryFile() as messages:
        process = subprocess.Popen(command + shlex.split(options.arguments), stdout=subprocess.DEVNULL, stderr=messages)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            messages.seek(0)
            sys.exit(f"{folder}, seed {seed}: {messages.read().decode(errors='replace').strip()}")
    return judged(folder, out) | {"seconds": used.ru_utime + used.ru_stime}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", help="the program mono-slam")
    parser.add_argument("seeds", type=seeds, help="as 6-10")
    parser.add_argument("sequences", nargs="+", type=sequence, metavar="SEQUENCE", help="FOLDER or FOLDER=PRESET")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--out", help="keep the runs in this folder")
    parser.add_argument("--arguments", default="", help="further arguments of each run, in one word")
    options = parser.parse_args()
    print("| sequence | rmse | max | freed | heading | smooth | band % | nees | seconds |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        options.out = options.out or scratch
        for folder, preset in options.sequences:
            found = list(pool.map(lambda seed: run(options, folder, preset, seed), options.seeds))
            mean = {name: statistics.fmean(one[name] for one in found) for name in found[0]}
            spread = statistics.stdev(one["rmse"] for one in found) if len(found) > 1 else 0.0
            print(
                f"| {folder.resolve().name} | {mean['rmse']:.1f} ± {spread:.1f} | {max(one['rmse'] for one in found):.1f} "
                f"| {mean['freed']:.1f} | {mean['heading']:.1f} | {mean['smooth']:.1f} | {mean['band']:.1f} "
                f"| {mean['nees']:.2f} | {mean['seconds']:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
