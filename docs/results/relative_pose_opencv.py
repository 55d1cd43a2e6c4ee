"""Relative pose from real matches: this crate's RANSAC beside OpenCV's on the very same matches.

    cargo build --release -p mono-geometry --example relative_pose
    python relative_pose_opencv.py target/release/examples/relative_pose SEQUENCE [--gaps 1 3 5] [--every 5]
        [--ratio 0.8] [--threshold 1.0] [--repeat 5] [--seeds 1] [--csv FILE]

SEQUENCE is a folder with images/, camera.toml and groundtruth.txt (TUM, camera-to-world). Frames k and k + gap are matched
by OpenCV's SIFT with a ratio test, each keypoint of the second image once; lenses are removed. All methods get these matches,
an inlier threshold of THRESHOLD pixels (Sampson; ours is given 0.51 THRESHOLD as standard deviation, so 1.96 of them),
confidence 0.999 and at most 10 000 trials. OpenCV: findEssentialMat and recoverPose of its inliers. Times: processor
time, the median of REPEAT calls, the methods after one another on each pair. A method that gives no pose has failed:
its errors count as 180 degrees. Needs numpy and opencv-python-headless.
"""

import argparse
import csv
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import cv2
import numpy as np

OPENCV = {
    "RANSAC": cv2.RANSAC,
    "USAC_DEFAULT": cv2.USAC_DEFAULT,
    "USAC_ACCURATE": cv2.USAC_ACCURATE,
    "USAC_MAGSAC": cv2.USAC_MAGSAC,
}
TRIALS = 10_000


def rotation(qx: float, qy: float, qz: float, qw: float) -> np.ndarray:
    return np.array([
        [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
        [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
        [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)]])


def sequence(folder: Path):
    camera = tomllib.loads((folder / "camera.toml").read_text())
    poses = []
    for row in np.loadtxt(folder / "groundtruth.txt"):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation(*row[4:]), row[1:4]
        poses.append(pose)
    return camera, poses, sorted((folder / "images").iterdir())


def matched(a, b, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n x 4) and quality of the matches, higher is better."""
    rows = {}
    if a[1] is not None and b[1] is not None:
        for pair in cv2.BFMatcher(cv2.NORM_L2).knnMatch(a[1], b[1], k=2):
            if len(pair) == 2 and pair[0].distance < ratio * pair[1].distance:
                best, share = pair[0], pair[0].distance / pair[1].distance
                if best.trainIdx not in rows or share < rows[best.trainIdx][1]:
                    rows[best.trainIdx] = (best.queryIdx, share)
    points = [[*a[0][query].pt, *b[0][train].pt] for train, (query, _) in rows.items()]
    return np.array(points).reshape(-1, 4), -np.array([share for _, share in rows.values()])


def degrees(truth: np.ndarray, r: np.ndarray, t: np.ndarray) -> tuple[float, float]:
    turn = truth[:3, :3].T @ r
    # atan2 of sine and cosine keeps the digits at small angles.
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    towards = truth[:3, 3]
    return (np.degrees(np.arctan2(np.linalg.norm(axis), np.trace(turn) - 1)),
            np.degrees(np.arctan2(np.linalg.norm(np.cross(towards, t.ravel())), towards @ t.ravel())))


def opencv(method: int, points: np.ndarray, camera: np.ndarray, threshold: float, seed: int):
    cv2.setRNGSeed(seed)
    first, second = np.ascontiguousarray(points[:, :2]), np.ascontiguousarray(points[:, 2:])
    start = time.thread_time()
    essential, mask = cv2.findEssentialMat(first, second, camera, method, 0.999, threshold, TRIALS)
    if essential is None or essential.shape != (3, 3):
        return None, 1e3 * (time.thread_time() - start)
    inliers = int(np.count_nonzero(mask))
    _, r, t, _ = cv2.recoverPose(essential, first, second, camera, mask=mask)
    return (r, t, inliers), 1e3 * (time.thread_time() - start)


def ours(program: str, file: Path, method: str, options, seed: int):
    text = subprocess.run([program, file, method, "--sigma", str(options.threshold / 1.959963985), "--seed", str(seed),
                           "--repeat", str(options.repeat)], check=True, capture_output=True, text=True).stdout
    told = {line.split()[0]: line.split()[1:] for line in text.splitlines()}
    spent = float(told["milliseconds"][0])
    if "rotation" not in told:
        return None, spent
    numbers = {key: np.array([float(word) for word in told[key]]) for key in ("rotation", "direction")}
    return (numbers["rotation"].reshape(3, 3), numbers["direction"], int(told["inliers"][0])), spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--gaps", nargs="+", type=int, default=[1, 3, 5])
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--ratio", type=float, default=0.8)
    parser.add_argument("--threshold", type=float, default=1.0)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    camera, truth, images = sequence(options.sequence)
    matrix = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1.0]])
    lens = np.array([camera.get("distortion", {}).get(k, 0.0) for k in ("k1", "k2", "p1", "p2", "k3")])
    mount = np.array(camera["mount"]["rotation_body_from_camera"]).ravel()
    sift = cv2.SIFT_create()
    features, rows = {}, []

    def seen(k: int):
        if k not in features:
            features[k] = sift.detectAndCompute(cv2.imread(str(images[k]), cv2.IMREAD_GRAYSCALE), None)
        return features[k]

    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "matches.txt"
        for gap in options.gaps:
            for k in range(0, len(images) - gap, options.every):
                points, quality = matched(seen(k), seen(k + gap), options.ratio)
                if len(points) < 8:
                    print(f"frames {k} and {k + gap}: {len(points)} matches, left out", file=sys.stderr)
                    continue
                ideal = np.hstack([cv2.undistortPoints(points[:, None, side], matrix, lens, P=matrix)[:, 0]
                                   for side in (slice(0, 2), slice(2, 4))])
                lines = [f"camera {camera['fx']} {camera['fy']} {camera['cx']} {camera['cy']}",
                         "mount " + " ".join(str(v) for v in mount)]
                lines += ["match " + " ".join(f"{v:.9f}" for v in (*p, q)) for p, q in zip(ideal, quality)]
                file.write_text("\n".join(lines) + "\n")
                motion = np.linalg.inv(truth[k + gap]) @ truth[k]
                for seed in range(options.seeds):
                    answers = {}
                    for name, method in OPENCV.items():
                        tries = [opencv(method, ideal, matrix, options.threshold, seed) for _ in range(options.repeat)]
                        answers[name] = tries[0][0], float(np.median([spent for _, spent in tries]))
                    for name in ("five", "prosac", "planar"):
                        answers[f"ours {name}"] = ours(options.program, file, name, options, seed)
                    for name, (pose, spent) in answers.items():
                        errors = (180.0, 180.0) if pose is None else degrees(motion, pose[0], pose[1])
                        rows.append([gap, k, seed, len(points), name, *errors, 0 if pose is None else pose[2], spent])
    if options.csv:
        with options.csv.open("w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow("gap frame seed matches method rotation_deg direction_deg inliers processor_ms".split())
            writer.writerows([*row[:5], *(f"{v:.4f}" for v in row[5:7]), row[7], f"{row[8]:.3f}"] for row in rows)
    print("| gap | pairs | matches | method | rotation deg, median | 90 % | direction deg, median | 90 % | inliers | ms, median | 90 % |")
    print("|--:|--:|--:|---|--:|--:|--:|--:|--:|--:|--:|")
    for gap in options.gaps:
        for name in dict.fromkeys(row[4] for row in rows):
            of = [row for row in rows if row[0] == gap and row[4] == name]
            column = {key: np.array([row[i] for row in of]) for i, key in enumerate("gkse-rdit") if key != "-"}
            print(f"| {gap} | {len(of)} | {column['e'].mean():.0f} | {name} | "
                  + " | ".join(f"{np.quantile(column[c], q):.3f}" for c in "rd" for q in (0.5, 0.9))
                  + f" | {column['i'].mean():.1f} | {np.median(column['t']):.2f} | {np.quantile(column['t'], 0.9):.2f} |")


if __name__ == "__main__":
    main()
