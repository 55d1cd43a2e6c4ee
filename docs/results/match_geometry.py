"""Matches between frames of a sequence and the share of them one fundamental matrix explains.

    python match_geometry.py PROGRAM IMAGE_FOLDER [--gaps 1 5 10] [--ratio 0.7]

PROGRAM is `mono-slam`. Frames i and i + gap are matched by it; OpenCV's RANSAC (1.5 px, confidence 0.999) judges. Needs
numpy and opencv-python-headless.
"""

import argparse
import csv
import subprocess
import tempfile
from pathlib import Path
from statistics import mean, median

import cv2
import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--gaps", nargs="+", type=int, default=[1, 5, 10])
    parser.add_argument("--ratio", default="0.7")
    options = parser.parse_args()
    frames = sorted(options.folder.iterdir())
    with tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "matches.csv"
        for gap in options.gaps:
            counts, kept = [], []
            for i in range(0, len(frames) - gap, max(gap, 4)):
                subprocess.run([options.program, "match", frames[i], frames[i + gap], "--ratio", options.ratio,
                                "--out", table], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                rows = [[float(row[k]) for k in ("xa", "ya", "xb", "yb")] for row in csv.DictReader(table.open())]
                points = np.array(rows).reshape(-1, 4)
                cv2.setRNGSeed(1)
                mask = None
                if len(points) >= 8:
                    _, mask = cv2.findFundamentalMat(points[:, :2], points[:, 2:], cv2.FM_RANSAC, 1.5, 0.999, 10000)
                counts.append(len(points))
                kept.append(0 if mask is None else int(mask.sum()))
            shares = [k / n for k, n in zip(kept, counts) if n]
            print(f"gap {gap}: {len(counts)} pairs, {mean(counts):.0f} matches a pair (least {min(counts)}), "
                  f"explained {sum(kept) / sum(counts):.4f}, median {median(shares):.4f}, worst {min(shares):.3f}")


if __name__ == "__main__":
    main()
