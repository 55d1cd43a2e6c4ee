"""Makes maps of real SIFT descriptors, queries to them and the exact answers, for nearest_neighbours.py.

    python nearest_neighbours_data.py DIR --images PATH... --outside PATH... [--sizes N...]

A PATH is a picture or a folder of pictures; `folder@15` takes each fifteenth one, so that a sequence shows each
place about once. Keypoints of `--images` become the map, those of `--outside` are only ever asked for.

1. Round 0 describes the pictures as they are, every further round a seeded warp of each (rotation, scale,
   perspective, brightness, blur, noise), until the largest map is filled. A keypoint that lies, carried back to the
   unwarped picture, where one of an earlier round lies (3 px, half an octave, 20 degrees, together one ball) is
   dropped: a landmark enters once. From round 8 on nothing is dropped, since pictures do not hold more landmarks: the
   largest maps contain several views of one landmark.
2. A map of n takes the fewest rounds that hold n keypoints, then the strongest keypoints of eight or more pictures.
3. 200 queries come from held-out milder warps of the pictures in the map, 100 from pictures outside it.
4. The exact two nearest come from integer distances in float32 products (every partial sum is below 2^24, so they are
   exact); the lower row wins ties.

Files: base_<n>.u8, query_<n>.u8 and insert.u8 (rows of 128 bytes, row-major), truth_<n>.npy (300 x 4 int64: nearest
id, second id, their squared distances), README. Everything follows from the seed and the version of OpenCV.
Needs numpy, scipy and opencv-python-headless.
"""

import argparse
from multiprocessing import get_context
from multiprocessing.pool import Pool
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

SIZES = [1000, 1500, 3000, 10000, 30000, 100000, 300000, 1000000]
QUERIES, FROM_MAP, INSERTS, RATIO = 300, 200, 1000, 0.8
SEED, STRONGEST = 20261124, 4000
UNIQUE_ROUNDS, MOST_ROUNDS = 8, 200


def pictures(paths: list[str]) -> list[np.ndarray]:
    """Gray pictures, in the order of the arguments and of the names in a folder."""
    found = []
    for path in paths:
        name, _, step = path.partition("@")
        files = sorted(Path(name).iterdir())[:: int(step or 1)] if Path(name).is_dir() else [name]
        for file in files:
            picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
            if picture is None:
                raise SystemExit(f"not a picture: {file}")
            found.append(picture)
    return found


def warp(picture: np.ndarray, rng: np.random.Generator, strength: float) -> tuple[np.ndarray, np.ndarray]:
    """A warped picture and the homography that made it; mirrored beyond its border."""
    height, width = picture.shape
    angle = rng.uniform(-np.pi, np.pi) * strength
    scale = 1.7 ** rng.uniform(-strength, strength)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    centre = corners.mean(axis=0)
    rotation = scale * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    moved = (corners - centre) @ rotation
    moved += rng.uniform(-0.12, 0.12, (4, 2)) * strength * scale * min(height, width)
    moved -= moved.min(axis=0)
    size = np.ceil(moved.max(axis=0)).astype(int)
    homography = cv2.getPerspectiveTransform(corners.astype(np.float32), moved.astype(np.float32))
    mirrored = {"flags": cv2.INTER_AREA, "borderMode": cv2.BORDER_REFLECT_101}
    out = cv2.warpPerspective(picture, homography, size.tolist(), **mirrored)
    out = cv2.GaussianBlur(out, (0, 0), rng.uniform(0.05, 1.2)).astype(np.float32)
    out = out * rng.uniform(0.7, 1.25) + rng.uniform(-20, 20) + rng.normal(0, rng.uniform(0, 4), out.shape)
    return np.clip(np.rint(out), 0, 255).astype(np.uint8), homography


def describe(picture: np.ndarray, key: tuple[int, ...] | None, strength: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Places in the unwarped picture (x, y, scale, orientation, made for one ball) and descriptors, strongest first."""
    cv2.setNumThreads(1)
    height, width = picture.shape
    homography = np.eye(3)
    if key is not None:
        picture, homography = warp(picture, np.random.default_rng(key), strength)
    points, descriptors = cv2.SIFT_create(nfeatures=STRONGEST).detectAndCompute(picture, None)
    if not points:
        return np.empty((0, 6), np.float32), np.empty((0, 128), np.uint8)
    order = np.argsort([-p.response for p in points], kind="stable")
    at = np.array([p.pt for p in points])[order]
    turn = np.radians([p.angle for p in points])[order]
    reach = np.array([p.size for p in points])[order, None]
    tip = at + reach * np.column_stack([np.cos(turn), np.sin(turn)])
    back = np.linalg.inv(homography)
    at, tip = (cv2.perspectiveTransform(x[None], back)[0] for x in (at, tip))
    arm = tip - at
    length = np.linalg.norm(arm, axis=1, keepdims=True)
    inside = ((at > 8) & (at < [width - 8, height - 8])).all(axis=1)
    place = np.hstack([at / 3, 2 * np.log2(length), arm / length / np.radians(20)])
    return place[inside].astype(np.float32), descriptors[order][inside].astype(np.uint8)


def fill(sources: list[np.ndarray], count: int, workers: Pool) -> list[list[np.ndarray]]:
    """For each picture the new descriptors of each round, until all of them are at least `count`."""
    pool = [[] for _ in sources]
    places = [[] for _ in sources]
    for turn in range(MOST_ROUNDS):
        jobs = [(s, (SEED, i, turn) if turn else None) for i, s in enumerate(sources)]
        for i, (place, rows) in enumerate(workers.starmap(describe, jobs, chunksize=1)):
            if 0 < turn < UNIQUE_ROUNDS and len(place):
                known = cKDTree(np.vstack(places[i]))
                new = np.isinf(known.query(place, distance_upper_bound=1.0)[0])
                place, rows = place[new], rows[new]
            places[i].append(place)
            pool[i].append(rows)
        total = sum(len(rows) for rounds in pool for rows in rounds)
        print(f"round {turn}: {total} keypoints", flush=True)
        if total >= count:
            return pool
    raise SystemExit(f"the pictures gave only {total} keypoints in {MOST_ROUNDS} rounds")


def choose(pool: list[list[np.ndarray]], n: int, rng: np.random.Generator) -> tuple[np.ndarray, dict[int, int], int]:
    """A map of n rows, how many each picture gave at most, and the rounds it needed."""
    for rounds in range(1, len(pool[0]) + 1):
        have = np.array([sum(len(rows) for rows in p[:rounds]) for p in pool])
        if have.sum() >= n:
            break
    quota = max(n // 8, 1)
    while np.minimum(have, quota).sum() < n:
        quota = quota * 5 // 4 + 1
    given, parts = {}, []
    for i in rng.permutation(len(pool)):
        if sum(given.values()) >= n:
            break
        rows = np.vstack(pool[i][:rounds])[:quota]
        given[int(i)] = len(rows)
        parts.append(rows)
    rows = np.vstack(parts)
    return rows[rng.permutation(len(rows))[:n]], given, rounds


def ask(
    sources: list[np.ndarray], outside: np.ndarray, given: dict[int, int], n: int, rng: np.random.Generator
) -> np.ndarray:
    """Queries: keypoints of held-out warps, as strong as those in the map, and keypoints from outside."""
    seen = []
    for i, most in given.items():
        rows = describe(sources[i], (SEED, i, MOST_ROUNDS, n), 0.4)[1][:most]
        seen.append(rows[rng.random(len(rows)) < 0.8])
    seen = np.vstack(seen)
    rows = [seen[rng.choice(len(seen), FROM_MAP, replace=False)]]
    rows.append(outside[rng.choice(len(outside), QUERIES - FROM_MAP, replace=False)])
    return np.vstack(rows)[rng.permutation(QUERIES)]


def two_nearest(base: np.ndarray, query: np.ndarray, block: int = 50000) -> np.ndarray:
    """Ids of the two nearest rows and their squared distances, the lower id first among equals."""
    wide = query.astype(np.float32)
    best = []
    for start in range(0, len(base), block):
        rows = base[start : start + block].astype(np.float32)
        distance = (wide**2).sum(1)[:, None] + (rows**2).sum(1)[None] - 2 * (wide @ rows.T)
        for _ in range(2):
            first = distance.argmin(axis=1)
            line = np.arange(len(query))
            best.append(np.column_stack([distance[line, first], first + start]).astype(np.int64))
            distance[line, first] = np.inf
    best = np.stack(best, axis=1)
    order = np.lexsort((best[..., 1], best[..., 0]), axis=1)[:, :2]
    two = np.take_along_axis(best, order[..., None], axis=1)
    return np.hstack([two[..., 1], two[..., 0]])


def make(folder: Path, images: list[str], outside: list[str], sizes: list[int]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    inner, outer = pictures(images), pictures(outside)
    notes = [f"{len(inner)} pictures in the maps, {len(outer)} outside; seed {SEED}, OpenCV {cv2.__version__}",
             "images: " + " ".join(images), "outside: " + " ".join(outside)]
    with get_context("fork").Pool(2) as workers:
        pool = fill(inner, max(sizes), workers)
        others = np.vstack([rows for _, rows in workers.map(describe_plain, outer)])
    rng = np.random.default_rng([SEED, 1])
    others = others[rng.permutation(len(others))]
    others[:INSERTS].tofile(folder / "insert.u8")
    notes.append("keypoints after each round: " + " ".join(
        str(sum(len(rows) for p in pool for rows in p[: r + 1])) for r in range(len(pool[0]))))
    for n in sizes:
        rng = np.random.default_rng([SEED, 2, n])
        base, given, rounds = choose(pool, n, rng)
        query = ask(inner, others[INSERTS:], given, n, rng)
        truth = two_nearest(base, query)
        base.tofile(folder / f"base_{n}.u8")
        query.tofile(folder / f"query_{n}.u8")
        np.save(folder / f"truth_{n}.npy", truth)
        passed = np.mean(truth[:, 2] < RATIO**2 * truth[:, 3])
        notes.append(f"n {n}: {len(given)} pictures, {rounds} views of each, ratio test {RATIO} passed by {passed:.3f}"
                     f" of {QUERIES} queries, equal to a row of the map {np.mean(truth[:, 2] == 0):.3f}")
        print(notes[-1], flush=True)
    (folder / "README").write_text((__doc__ or "") + "\n" + "\n".join(notes) + "\n")


def describe_plain(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return describe(picture, None)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--images", nargs="+", required=True)
    parser.add_argument("--outside", nargs="+", required=True)
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    options = parser.parse_args()
    make(options.folder, options.images, options.outside, options.sizes)
