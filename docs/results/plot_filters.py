"""Figures of the filters on whole problems.

    cargo run --release -p range-bearing-slam --example kim2008 -- --out out/kim2008
    cargo run --release -p range-bearing-slam --example mrclam -- --out out/mrclam
    cargo run --release -p range-bearing-slam --example victoria_park -- --out out/victoria
    python docs/results/plot_filters.py out docs/images

Needs numpy and matplotlib.
"""

import csv
import sys
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

BAND = (2.19, 3.93)
COLOURS = {
    "truth": "black",
    "fixes": "black",
    "dead reckoning": "0.65",
    "FastSLAM 2.0": "tab:orange",
    "FastSLAM 2.0 exact weights": "tab:orange",
    "unscented": "tab:blue",
    "unscented folded": "tab:green",
    "unscented without barcodes": "tab:purple",
}


def read(path):
    with open(path, newline="", encoding="ascii") as file:
        return list(csv.DictReader(file))


def nees(folder, images):
    series = defaultdict(list)
    for row in read(folder / "nees.csv"):
        series[int(row["particles"]), row["filter"]].append((float(row["time_s"]), float(row["nees"])))
    counts = sorted({count for count, _ in series})
    figure, axes = plt.subplots(1, len(counts), figsize=(4 * len(counts), 3.4), sharey=True, squeeze=False)
    for axis, count in zip(axes[0], counts):
        axis.axhspan(*BAND, color="tab:green", alpha=0.3, label="95 % band")
        for (particles, name), values in series.items():
            if particles == count:
                time, value = np.array(values).T
                axis.plot(time, value, color=COLOURS[name], lw=0.9, label=name)
        axis.set_yscale("log")
        axis.set_ylim(0.5, 1e5)
        axis.set_xlabel("time / s")
        axis.set_title(f"{count} particles")
    axes[0][0].set_ylabel("NEES, mean of the runs")
    axes[0][-1].legend(loc="upper left", fontsize=8)
    save(figure, images / "kim2008-nees.svg")


def errors(folder, images):
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.6))
    sweep = read(folder / "sweep.csv")
    noises = list(dict.fromkeys(row["noise"] for row in sweep))
    names = [name for name in dict.fromkeys(row["filter"] for row in sweep) if name in COLOURS]
    for shift, name in enumerate(names):
        rows = [row for row in sweep if row["filter"] == name]
        axes[0].bar(
            np.arange(len(rows)) + 0.25 * (shift - 1),
            [float(row["MSE m^2"]) for row in rows],
            0.25,
            yerr=[float(row["MSE m^2 error"]) for row in rows],
            color=COLOURS[name],
            label=name,
        )
    axes[0].set_xticks(range(len(noises)), [noise.replace(" m ", " m\n") for noise in noises], fontsize=8)
    axes[0].set_ylabel("mean squared position error / m$^2$")
    axes[0].set_title("25 x 20 m, 10 particles")
    axes[0].legend(fontsize=8)
    counts = read(folder / "particles.csv")
    for name in names:
        rows = [row for row in counts if row["filter"] == name]
        axes[1].errorbar(
            [float(row["particles"]) for row in rows],
            [float(row["MSE aligned m^2"]) for row in rows],
            [float(row["MSE aligned m^2 error"]) for row in rows],
            color=COLOURS[name],
            marker="o",
            capsize=2,
            label=name,
        )
    axes[1].set_xscale("log")
    axes[1].set_yscale("log")
    axes[1].set_xlabel("particles")
    axes[1].set_ylabel("the same, path aligned / m$^2$")
    axes[1].set_title("100 x 100 m, 500 m of path, 0.2 m and 6 degrees")
    axes[1].legend(fontsize=8)
    save(figure, images / "kim2008-errors.svg")


def points(rows, name, kind):
    return np.array(
        [[float(row["x_m"]), float(row["y_m"])] for row in rows if row["filter"] == name and row["kind"] == kind]
    ).reshape(-1, 2)


def fit(source, target):
    """Rotation and shift from source to target, least squares."""
    a, b = source - source.mean(0), target - target.mean(0)
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return lambda p: (p - source.mean(0)) @ rotation.T + target.mean(0)


def mrclam(folder, images):
    figure, axes = plt.subplots(2, 3, figsize=(12, 8.5))
    for robot, axis in zip(range(1, 6), axes.flat):
        rows = read(folder / f"mrclam_robot{robot}.csv")
        truth = points(rows, "truth", "pose")
        for name in ["dead reckoning", "truth", "FastSLAM 2.0", "unscented", "unscented without barcodes"]:
            path = points(rows, name, "pose")
            move = fit(path, truth)
            axis.plot(*move(path).T, color=COLOURS[name], lw=0.8, label=name)
            landmarks = points(rows, name, "landmark")
            if len(landmarks):
                mark, size = ("*", 90) if name == "truth" else ("x", 30)
                axis.scatter(*move(landmarks).T, color=COLOURS[name], marker=mark, s=size, lw=1.2)
        axis.set_aspect("equal")
        axis.set_xlim(truth[:, 0].min() - 3, truth[:, 0].max() + 3)
        axis.set_ylim(truth[:, 1].min() - 3, truth[:, 1].max() + 3)
        axis.set_title(f"robot {robot}")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    axes[1, 2].axis("off")
    axes[1, 2].legend(handles, labels, loc="center", title="paths aligned; stars surveyed,\ncrosses estimated landmarks")
    save(figure, images / "mrclam-maps.png")


def victoria(folder, images):
    rows = read(folder / "victoria_park.csv")
    figure, axes = plt.subplots(1, 3, figsize=(14, 5), sharex=True, sharey=True)
    fixes = points(rows, "fixes", "pose")
    for axis, name in zip(axes, ["dead reckoning", "FastSLAM 2.0", "unscented"]):
        axis.scatter(*fixes.T, color="black", s=1, label="satellite fixes")
        axis.plot(*points(rows, name, "pose").T, color=COLOURS[name], lw=0.9, label=name)
        axis.scatter(*points(rows, name, "landmark").T, color="tab:green", s=6, marker="x", label="trunks", lw=0.8)
        axis.set_aspect("equal")
        axis.set_title(name + ("" if name == "dead reckoning" else ", 50 particles"))
        axis.legend(fontsize=8, loc="lower right")
        axis.set_xlim(fixes[:, 0].min() - 60, fixes[:, 0].max() + 60)
        axis.set_ylim(fixes[:, 1].min() - 60, fixes[:, 1].max() + 60)
        axis.set_xlabel("m")
    save(figure, images / "victoria-park.png")


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    source, images = Path(sys.argv[1]), Path(sys.argv[2])
    nees(source / "kim2008", images)
    errors(source / "kim2008", images)
    mrclam(source / "mrclam", images)
    victoria(source / "victoria", images)


if __name__ == "__main__":
    main()
