#!/usr/bin/env python3
"""Writes evo_{spatial,planar}_{reference,estimate}.tum and evo_numbers.json beside itself.

Needs: pip install evo (the version used is in evo_numbers.json). The trajectories
are closed forms, so the files do not depend on a generator of random numbers. Both pairs
have different rates and missing stretches, so that the association in time matters.
"""

import json
import math
import pathlib

import evo
from evo.core import metrics, sync
from evo.core.metrics import PoseRelation, Unit
from evo.tools import file_interface

HERE = pathlib.Path(__file__).parent


def quaternion(roll, pitch, yaw):
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def spatial(t):
    return (3 * math.sin(0.5 * t), 2 * math.cos(0.7 * t), 0.4 * math.sin(1.1 * t)), (
        0.2 * math.sin(t), 0.15 * math.cos(0.8 * t), 0.6 * t)


def planar(t):
    return (2 * math.sin(0.4 * t), 2 - 2 * math.cos(0.4 * t), 0.0), (0.0, 0.0, 0.4 * t)


def disturbed(path, t, flat):
    """The path with errors, moved, turned about z and scaled."""
    (x, y, z), (roll, pitch, yaw) = path(t)
    x += 0.05 * math.sin(9.1 * t) + 0.01 * t
    y += 0.04 * math.cos(7.3 * t)
    yaw += 0.03 * math.sin(5.7 * t) + 0.3
    if not flat:
        z += 0.03 * math.sin(11.9 * t)
        roll += 0.02 * math.cos(6.1 * t)
    c, s, scale = math.cos(0.3), math.sin(0.3), 0.9
    return (scale * (c * x - s * y) + 1.5, scale * (s * x + c * y) - 0.5, scale * z), (roll, pitch, yaw)


def write(name, rows):
    with open(HERE / name, "w") as file:
        file.write("# t_s x y z qx qy qz qw\n")
        for t, (position, angles) in rows:
            values = (*position, *quaternion(*angles))
            file.write(f"{t:.6f} " + " ".join(f"{value:.9f}" for value in values) + "\n")


def measure(reference_name, estimate_name):
    results = {}
    for alignment in ("none", "se3", "sim3"):
        reference = file_interface.read_tum_trajectory_file(str(HERE / reference_name))
        estimate = file_interface.read_tum_trajectory_file(str(HERE / estimate_name))
        reference, estimate = sync.associate_trajectories(reference, estimate, max_diff=0.01)
        if alignment != "none":
            estimate.align(reference, correct_scale=alignment == "sim3")
        entry = {"pairs": reference.num_poses}
        for name, relation in (("translation", PoseRelation.translation_part), ("rotation", PoseRelation.rotation_angle_rad)):
            ape = metrics.APE(relation)
            ape.process_data((reference, estimate))
            entry[f"ape_{name}"] = {key: float(value) for key, value in ape.get_all_statistics().items()}
            entry[f"ape_{name}_final"] = float(ape.error[-1])
            for delta in (1, 5):
                rpe = metrics.RPE(relation, delta=delta, delta_unit=Unit.frames, all_pairs=False)
                rpe.process_data((reference, estimate))
                entry[f"rpe{delta}_{name}"] = {key: float(value) for key, value in rpe.get_all_statistics().items()}
        results[alignment] = entry
    return results


def main():
    for kind, path in (("spatial", spatial), ("planar", planar)):
        write(f"evo_{kind}_reference.tum", [(0.05 * k, path(0.05 * k)) for k in range(121)])
        estimate_times = [0.1 * k + 0.004 * math.sin(3.0 * k) for k in range(61) if not 20 <= k < 26]
        estimate_times += [6.5, 6.6]
        write(f"evo_{kind}_estimate.tum", [(t, disturbed(path, t, kind == "planar")) for t in estimate_times])
    numbers = {
        "evo_version": evo.__version__,
        "spatial": measure("evo_spatial_reference.tum", "evo_spatial_estimate.tum"),
        "planar": measure("evo_planar_reference.tum", "evo_planar_estimate.tum"),
    }
    (HERE / "evo_numbers.json").write_text(json.dumps(numbers, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
