"""The same photographs through OpenCV and through `mono-slam calibrate`, side by side.

    cargo build --release -p mono-slam
    python calibration_opencv.py IMAGE_FOLDER --board 9x6 --square 0.04 --mono-slam target/release/mono-slam [--truth CAMERA.toml]

OpenCV: findChessboardCorners + cornerSubPix (11x11 window and the largest that holds no second corner), and
findChessboardCornersSB; calibrateCameraExtended with k1 k2 p1 p2 k3, as ours. Ours: the program, its camera.toml. A third pairing,
OpenCV's solver on our corners, separates corners from mathematics. Residuals are root mean square distances over all corners;
standard deviations OpenCV's own and ours. Times are wall clock on one thread, images read within them.
Needs numpy and opencv-python-headless (or opencv-contrib).
"""

import argparse
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

NAMES = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"]


def images(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.suffix.lower() in {".png", ".jpg", ".jpeg"})


def board_points(columns: int, rows: int, square: float) -> np.ndarray:
    points = np.zeros((columns * rows, 3), np.float32)
    points[:, :2] = square * np.mgrid[0:columns, 0:rows].T.reshape(-1, 2)
    return points


def classic(grey: np.ndarray, size: tuple[int, int], half_window: int | None) -> np.ndarray | None:
    """findChessboardCorners and cornerSubPix; without a window the largest one that holds no second corner."""
    found, corners = cv2.findChessboardCorners(
        grey, size, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    corners = corners.reshape(-1, 1, 2)
    if half_window is None:
        grid = corners.reshape(size[1], size[0], 2)
        nearest = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
        half_window = max(2, int(0.4 * nearest))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    return cv2.cornerSubPix(grey, corners, (half_window, half_window), (-1, -1), criteria)


def sector_based(grey: np.ndarray, size: tuple[int, int]) -> np.ndarray | None:
    found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE)
    return corners.reshape(-1, 1, 2) if found else None


def calibrate(corner_lists: list[np.ndarray], points: np.ndarray, shape: tuple[int, int]) -> dict:
    rms, matrix, lens, rotations, translations, sigmas, _, _ = cv2.calibrateCameraExtended(
        [points] * len(corner_lists), [c.astype(np.float32) for c in corner_lists], shape, None, None)
    lens = lens.ravel()
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *lens[:5]]
    distances = [np.linalg.norm(cv2.projectPoints(points, r, t, matrix, lens)[0] - c, axis=2).ravel()
                 for r, t, c in zip(rotations, translations, corner_lists)]
    return {"rms": rms, "mean": float(np.concatenate(distances).mean()), "values": values, "sigmas": sigmas.ravel()[:9],
            "boards": len(corner_lists)}


def ours(program: str, folder: Path, board: str, square: float) -> dict:
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "camera.toml"
        start = time.perf_counter()
        done = subprocess.run([program, "calibrate", str(folder), "--board", board, "--square", str(square), "--out", str(out)],
                              capture_output=True, text=True, check=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        seconds = time.perf_counter() - start
        text = out.read_text()
    pairs = dict((n, (float(v), float(s))) for n, v, s in
                 re.findall(r"^(\w+) = (\S+) +# \+- ([\d.]+)", text, re.M))
    rms, mean = map(float, re.search(r"RMS ([\d.]+) px, mean ([\d.]+) px", done.stdout).groups())
    return {"rms": rms, "mean": mean, "values": [pairs[n][0] for n in NAMES], "sigmas": [pairs[n][1] for n in NAMES],
            "boards": int(done.stdout.split()[0]), "seconds": seconds}


def our_corners(finder: str, files: list[Path], board: str) -> list[np.ndarray]:
    text = subprocess.run([finder, board, *map(str, files)], capture_output=True, text=True, check=True).stdout
    lists: list[list] = []
    for line in text.splitlines():
        numbers = line.split()
        if len(numbers) == 2 and re.fullmatch(r"[\d.-]+", numbers[0]):
            lists[-1].append([float(v) for v in numbers])
        else:
            lists.append([])
    return [np.array(c).reshape(-1, 1, 2) for c in lists if c]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--board", default="9x6")
    parser.add_argument("--square", type=float, default=0.04)
    parser.add_argument("--mono-slam", default="target/release/mono-slam")
    parser.add_argument("--find-board", help="the example find_board of camera-calibration: OpenCV's solver on our corners")
    parser.add_argument("--truth", type=Path, help="camera.toml with the true camera")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    columns, rows = map(int, options.board.split("x"))
    points = board_points(columns, rows, options.square)
    files = images(options.folder)
    results = {}
    ways = {
        "OpenCV classic, 11x11": lambda grey: classic(grey, (columns, rows), 5),
        "OpenCV classic, wide window": lambda grey: classic(grey, (columns, rows), None),
        "OpenCV SB": lambda grey: sector_based(grey, (columns, rows)),
    }
    for name, find in ways.items():
        start = time.perf_counter()
        found = [find(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in files]
        height, width = cv2.imread(str(files[0]), cv2.IMREAD_GRAYSCALE).shape
        detection = time.perf_counter() - start
        usable = [c for c in found if c is not None]
        if len(usable) < 3:
            print(f"{name}: {len(usable)} boards")
            continue
        results[name] = calibrate(usable, points, (width, height))
        results[name]["seconds"] = time.perf_counter() - start
        print(f"{name}: corners of {len(files)} images in {detection:.2f} s")
    if options.find_board:
        found = our_corners(options.find_board, files, options.board)
        results["OpenCV solver, our corners"] = calibrate(found, points, (width, height)) | {"seconds": float("nan")}
    results["mono-slam calibrate"] = ours(options.mono_slam, options.folder, options.board, options.square)

    print(f"\nOpenCV {cv2.__version__}, {len(files)} images of {width}x{height}\n")
    print("| | boards | RMS px | mean px | s | " + " | ".join(NAMES) + " |")
    print("|---|--:|--:|--:|--:|" + "--:|" * len(NAMES))
    for name, r in results.items():
        cells = [f"{v:.3f} +- {s:.3f}" if k < 4 else f"{v:.5f} +- {s:.5f}" for k, (v, s) in enumerate(zip(r["values"], r["sigmas"]))]
        print(f"| {name} | {r['boards']} | {r['rms']:.4f} | {r['mean']:.4f} | {r['seconds']:.2f} | " + " | ".join(cells) + " |")
    if options.truth:
        text = options.truth.read_text()
        truth = [float(re.search(rf"^{n} = (\S+)", text, re.M)[1]) for n in NAMES]
        print("\nError in own standard deviations\n")
        for name, r in results.items():
            z = [(v - t) / s for v, t, s in zip(r["values"], truth, r["sigmas"])]
            print(f"| {name} | " + " | ".join(f"{v:+.2f}" for v in z) + " |")


if __name__ == "__main__":
    main()
