"""Shows that `mono-slam eval` gives the figures of evo, on ten pairs of trajectories, to 1e-9.

Every pair is written to a temporary folder and given to both: noise, other rates, clock offsets, repeated stamps, quaternions
of another length, paths in the plane and in space, aligned in every way that evo has. Compared are root mean square, mean,
median, standard deviation, minimum and maximum of the absolute error (position and angle) and of the relative error over 1 and
over 10 frames.

Run: pip install evo; python3 xtask/scripts/evo_equality.py PATH_OF_mono-slam
"""

import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

from evo.core import metrics, sync
from evo.tools import file_interface

FIGURES = ["rmse", "mean", "median", "std", "min", "max"]
LARGEST_DIFFERENCE = 1e-9


def path(rng, count, rate_hz, start_s, spatial, noise_m):
    """Rows t x y z qx qy qz qw of a wandering drive with its noise."""
    rows, x, y, z, heading, tilt = [], 0.0, 0.0, 0.0, 0.3, 0.0
    for k in range(count):
        t = start_s + k / rate_hz
        heading += (0.4 * math.sin(0.7 * t) + 0.1) / rate_hz
        tilt = 0.2 * math.sin(0.3 * t) if spatial else 0.0
        x += 0.5 * math.cos(heading) / rate_hz
        y += 0.5 * math.sin(heading) / rate_hz
        z = 0.3 * math.sin(0.5 * t) if spatial else 0.0
        turn = heading + rng.gauss(0, noise_m)
        # Roll by tilt after the turn about z.
        cz, sz, cx, sx = math.cos(turn / 2), math.sin(turn / 2), math.cos(tilt / 2), math.sin(tilt / 2)
        lift = rng.gauss(0, noise_m) if spatial else 0.0
        rows.append([t, x + rng.gauss(0, noise_m), y + rng.gauss(0, noise_m), z + lift,
                     cz * sx, sz * sx, sz * cx, cz * cx])
    return rows


def pairs(rng):
    """(name, estimate rows, reference rows, alignment, offset in s, largest difference in s)."""
    yield "planar, as it is", path(rng, 300, 10, 0, False, 0.01), path(rng, 300, 10, 0, False, 0), "none", 0.0, 0.01
    yield "spatial, as it is", path(rng, 300, 10, 0, True, 0.01), path(rng, 300, 10, 0, True, 0), "none", 0.0, 0.01
    yield "spatial, se3", path(rng, 300, 10, 0, True, 0.02), path(rng, 300, 10, 0, True, 0), "se3", 0.0, 0.01
    yield "spatial, sim3", path(rng, 300, 10, 0, True, 0.02), path(rng, 300, 10, 0, True, 0), "sim3", 0.0, 0.01
    yield "reference ten times as fast", path(rng, 100, 10, 0, True, 0.01), path(rng, 1000, 100, 0, True, 0), "none", 0.0, 0.01
    yield "estimate ten times as fast", path(rng, 1000, 100, 0, True, 0.01), path(rng, 100, 10, 0, True, 0), "se3", 0.0, 0.01
    yield "stamps since 1970", path(rng, 200, 20, 1.7e9, True, 0.01), path(rng, 200, 20, 1.7e9, True, 0), "none", 0.0, 0.01
    yield "another clock", path(rng, 200, 20, 1000.25, True, 0.01), path(rng, 200, 20, 0, True, 0), "none", -1000.25, 0.01
    doubled = [row for row in path(rng, 200, 20, 0, True, 0) for _ in range(1 + (int(row[0] * 20) % 7 == 0))]
    yield "repeated stamps", path(rng, 200, 20, 0, True, 0.01), doubled, "none", 0.0, 0.01
    loose = [row[:4] + [1.01 * v for v in row[4:]] for row in path(rng, 200, 20, 0.03, True, 0.01)]
    yield "other lengths, 30 ms beside", loose, path(rng, 200, 20, 0, True, 0), "none", 0.0, 0.04


def write(file, rows):
    file.write_text("".join(" ".join(repr(v) for v in row) + "\n" for row in rows))


def of_evo(estimate, reference, align, offset_s, most_s, delta):
    reference = file_interface.read_tum_trajectory_file(str(reference))
    estimate = file_interface.read_tum_trajectory_file(str(estimate))
    reference, estimate = sync.associate_trajectories(reference, estimate, max_diff=most_s, offset_2=offset_s)
    if align != "none":
        estimate.align(reference, correct_scale=align == "sim3")
    out = {}
    for name, metric in [
        ("ate translation", metrics.APE(metrics.PoseRelation.translation_part)),
        ("ate rotation", metrics.APE(metrics.PoseRelation.rotation_angle_rad)),
        ("rpe translation", metrics.RPE(metrics.PoseRelation.translation_part, delta, metrics.Unit.frames)),
        ("rpe rotation", metrics.RPE(metrics.PoseRelation.rotation_angle_rad, delta, metrics.Unit.frames)),
    ]:
        metric.process_data((reference, estimate))
        out[name] = metric.get_all_statistics()
    return len(estimate.timestamps), out


def of_program(program, estimate, reference, align, offset_s, most_s, delta):
    done = subprocess.run(
        [program, "eval", estimate, reference, "--align", align, "--time-offset", str(offset_s),
         "--max-time-difference", str(most_s), "--delta", str(delta), "--json"],
        capture_output=True, text=True, check=True)
    read = json.loads(done.stdout)
    return read["pairs"], {
        "ate translation": read["ate"]["translation_m"],
        "ate rotation": read["ate"]["rotation_rad"],
        "rpe translation": read["rpe"]["translation_m"],
        "rpe rotation": read["rpe"]["rotation_rad"],
    }


def main():
    program, rng, worst = sys.argv[1], random.Random(7), 0.0
    print(f"{'pair':<30}{'align':>7}{'poses':>7}{'largest difference':>21}")
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder) / "estimate.tum", Path(folder) / "reference.tum"
        for name, estimate, reference, align, offset_s, most_s in pairs(rng):
            write(files[0], estimate)
            write(files[1], reference)
            largest = 0.0
            for delta in (1, 10):
                count, theirs = of_evo(*files, align, offset_s, most_s, delta)
                matched, ours = of_program(program, *files, align, offset_s, most_s, delta)
                assert matched == count, f"{name}: {matched} pairs, evo has {count}"
                for part, figures in theirs.items():
                    for figure in FIGURES:
                        largest = max(largest, abs(figures[figure] - ours[part][figure]))
            print(f"{name:<30}{align:>7}{count:>7}{largest:>21.3e}")
            worst = max(worst, largest)
    print(f"largest difference {worst:.3e}, allowed {LARGEST_DIFFERENCE:.0e}")
    sys.exit(int(worst > LARGEST_DIFFERENCE))


if __name__ == "__main__":
    main()
