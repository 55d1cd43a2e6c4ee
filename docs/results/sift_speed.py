"""Times this crate's SIFT and OpenCV's on the same pictures, one after the other on one core.

    cargo build --release -p vision-sift --features image --example time_images
    python sift_speed.py PICTURE... --ours "target/release/examples/time_images 1" [--ours ...] [--rounds 7] [--cores 1]

Every picture is read by all programs before it is timed. A round asks OpenCV and each of ours in turn, so that a slow
spell of the machine falls on all. Times are processor time: a neighbour on the same core then costs nothing but caches.
For each picture the median of the rounds counts; the last column is the median over pictures of ours / OpenCV's.
Of two threads (`time_images 2`, `--cores 0,1`) the answer of the program, its own elapsed time, is taken instead.
Needs opencv-python-headless.
"""

import argparse
import os
import subprocess
import time
from statistics import mean, median

import cv2


def busy(process: subprocess.Popen) -> float:
    """Processor time of all threads of a process, milliseconds."""
    tasks = f"/proc/{process.pid}/task"
    return sum(int(open(f"{tasks}/{task}/schedstat").read().split()[0]) for task in os.listdir(tasks)) / 1e6


def ask(process: subprocess.Popen, path: str, elapsed: bool) -> tuple[float, int, int]:
    """Milliseconds, keypoints and workspace bytes of one detection."""
    before = busy(process)
    process.stdin.write(path + "\n")
    process.stdin.flush()
    told = process.stdout.readline().split()
    return float(told[0]) if elapsed else busy(process) - before, int(told[1]), int(told[2])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", nargs="+")
    parser.add_argument("--ours", action="append", default=[], help="time_images with its arguments")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--cores", default="1", help="cores of ours; OpenCV runs on the first")
    parser.add_argument("--elapsed", action="store_true", help="elapsed time of ours, for two threads")
    options = parser.parse_args()
    cores = {int(core) for core in options.cores.split(",")}
    os.sched_setaffinity(0, cores)
    ours = [subprocess.Popen(line.split(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            for line in options.ours]
    os.sched_setaffinity(0, {min(cores)})
    cv2.setNumThreads(1)
    sift = cv2.SIFT_create()
    rows = []
    for path in options.pictures:
        image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        sift.detectAndCompute(image, None)
        for process in ours:
            ask(process, path, options.elapsed)
        spent = [[] for _ in range(len(ours) + 1)]
        counts, size = [0] * len(spent), [0] * len(spent)
        for _ in range(options.rounds):
            clock = time.perf_counter if options.elapsed else time.process_time
            start = clock()
            keypoints, _ = sift.detectAndCompute(image, None)
            spent[0].append(1e3 * (clock() - start))
            counts[0] = len(keypoints)
            for i, process in enumerate(ours, 1):
                ms, counts[i], size[i] = ask(process, path, options.elapsed)
                spent[i].append(ms)
        rows.append(([median(times) for times in spent], counts, size))
    for i, name in enumerate(["OpenCV", *options.ours]):
        times = [row[0][i] for row in rows]
        ratios = [row[0][i] / row[0][0] for row in rows]
        print(f"{name:60s} median {median(times):7.2f} ms, mean {mean(times):7.2f} ms, "
              f"keypoints {mean(row[1][i] for row in rows):6.0f}, workspace {max(row[2][i] for row in rows) / 1e6:6.1f} MB, "
              f"ratio {median(ratios):.3f}")


if __name__ == "__main__":
    main()
