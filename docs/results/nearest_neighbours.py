"""Times the two nearest neighbours of 300 SIFT descriptors in maps of 10^3 to 10^6: peers from PyPI and this crate.

One command, unattended; the data is made first where it is missing (nearest_neighbours_data.py explains it):

    python nearest_neighbours.py --data DIR --images PATH... --outside PATH... \\
        --ours "target/release/examples/scale DIR {size}" --rounds 5 --out results/nearest-neighbours

Writes OUT.csv, OUT.md and OUT.svg after every size (plot_nearest_neighbours.py draws them again from the CSV).
A million descriptors take most of the time: the three graphs are built in minutes each.
`--sizes`, `--rounds`, `--core`, `--skip NAME...` narrow a run. Times are wall-clock; `--cpu-time` takes the peers'
from the processor's clock instead, for a machine that is not quiet. A peer that is not installed is named and left out.

- One core: the process and its children are pinned to `--core`, every library is told to use one thread.
- Each peer builds its index of a size once. A round times every setting of every peer in turn, and ours once in its
  place among them; the order is rotated from round to round. One timing is the median of 3 to 20 calls of the whole
  batch of 300 after one that is not counted. The figure given is the median over rounds; ms_low and ms_high are the
  least and the greatest round.
- Recall: the first id is as near as the exact nearest. Ratio matches kept: of the queries whose exact neighbours pass
  the ratio test at 0.8, those where the method names the same nearest id and passes with its own second. Ratio matches
  added: the method's other passes, as a share of the exact ones. Distances are computed from the ids, so that
  rounding inside a peer costs it nothing.
- Inserts: ten batches of 100 new rows after the rounds, mean and worst. An index that cannot grow is built again.
- Bytes per descriptor: of the saved index where it holds the descriptors, else descriptors plus saved index.
- Ours: a command that prints CSV with the columns method, size, ms_per_300_queries, recall1, ratio_matches_kept,
  build_ms, insert100_ms_mean, insert100_ms_worst, bytes_per_descriptor. `{size}` and `{data}` in it are replaced;
  without `{size}` it runs once a round and the rows of other sizes are left out.

Needs numpy, scipy, matplotlib, opencv-python-headless; peers: faiss-cpu, usearch, hnswlib.
"""

import argparse
import csv
import os
import pickle
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

for name in ("OMP", "OPENBLAS", "MKL", "RAYON"):
    os.environ[f"{name}_NUM_THREADS"] = "1"

import cv2
import numpy as np

sys.dont_write_bytecode = True
import nearest_neighbours_data as data
import plot_nearest_neighbours as plot

OURS = ["ms_per_300_queries", "recall1", "ratio_matches_kept", "build_ms", "insert100_ms_mean", "insert100_ms_worst",
        "bytes_per_descriptor"]
COLUMNS = ["method", "size", "ms_per_300_queries", "ms_low", "ms_high", "recall1", "ratio_matches_kept",
           "ratio_matches_added", *OURS[3:], "rounds"]


class Peer:
    """One index. `settings` are (what is appended to the name, the value given to `search`)."""

    settings: list[tuple[str, int]] = [("", 0)]
    largest = 10**9
    grows = True

    def prepare(self, rows: np.ndarray) -> np.ndarray:
        """Rows as the library takes them; not timed."""
        return rows.astype(np.float32)

    def build(self, base: np.ndarray) -> None:
        raise NotImplementedError

    def search(self, query: np.ndarray, setting: int) -> object:
        raise NotImplementedError

    def ids(self, answer: object) -> np.ndarray:
        return np.asarray(answer, dtype=np.int64)

    def insert(self, rows: np.ndarray, start: int) -> None:
        raise NotImplementedError

    def bytes(self) -> float:
        raise NotImplementedError


class BruteForce(Peer):
    name = "OpenCV brute force"
    grows = False
    most = 200000  # OpenCV takes fewer than 2^18 rows in one matrix

    def build(self, base):
        self.base, self.matcher = base, cv2.BFMatcher(cv2.NORM_L2)
        self.matcher.add([base[i : i + self.most] for i in range(0, len(base), self.most)])

    def search(self, query, setting):
        return self.matcher.knnMatch(query, k=2)

    def ids(self, answer):
        return np.array([[match.imgIdx * self.most + match.trainIdx for match in pair] for pair in answer])

    def bytes(self):
        return self.base.nbytes


class Flann(Peer):
    name = "FLANN kd-forest"
    settings = [(f" checks {c}", c) for c in (32, 128, 512, 2048)]
    grows = False

    def build(self, base):
        cv2.setRNGSeed(1)
        self.base = base
        self.index = cv2.flann.Index(base, {"algorithm": 1, "trees": 4})

    def search(self, query, setting):
        return self.index.knnSearch(query, 2, params={"checks": setting})[0]

    def bytes(self):
        with tempfile.TemporaryDirectory() as folder:
            self.index.save(f"{folder}/index")
            return self.base.nbytes + os.path.getsize(f"{folder}/index")


class Usearch(Peer):
    name = "usearch i8 HNSW"
    settings = [(f" ef {ef}", ef) for ef in (16, 32, 64, 128)]

    def __init__(self):
        from usearch.index import Index

        self.index = Index(ndim=128, metric="l2sq", dtype="i8")

    def prepare(self, rows):
        return (rows.astype(np.int16) - 128).astype(np.int8)

    def build(self, base):
        self.insert(base, 0)

    def search(self, query, setting):
        self.index.expansion_search = setting
        return self.index.search(query, 2, threads=1).keys

    def insert(self, rows, start):
        self.index.add(np.arange(start, start + len(rows)), rows, threads=1)

    def bytes(self):
        return self.index.serialized_length


class Faiss(Peer):
    """What the three scalar-quantised indexes of faiss share; a byte is stored as it is."""

    def __init__(self):
        import faiss

        self.faiss, self.kind = faiss, faiss.ScalarQuantizer.QT_8bit_direct
        faiss.omp_set_num_threads(1)

    def build(self, base):
        self.index = self.make(len(base))
        self.index.train(base)
        self.index.add(base)

    def search(self, query, setting):
        return self.index.search(query, 2)[1]

    def insert(self, rows, start):
        self.index.add(rows)

    def bytes(self):
        return len(self.faiss.serialize_index(self.index))


class FaissFlat(Faiss):
    name = "faiss SQ8 flat"

    def make(self, n):
        return self.faiss.IndexScalarQuantizer(128, self.kind)


class FaissLists(Faiss):
    name = "faiss SQ8 IVF"
    settings = [(f" nprobe {p}", p) for p in (1, 2, 4, 8, 16, 32, 64)]

    def make(self, n):
        lists = int(4 * n**0.5)
        self.coarse = self.faiss.IndexFlatL2(128)
        index = self.faiss.IndexIVFScalarQuantizer(self.coarse, 128, lists, self.kind, self.faiss.METRIC_L2, False)
        index.cp.min_points_per_centroid, index.cp.max_points_per_centroid = 1, 64
        return index

    def search(self, query, setting):
        self.index.nprobe = setting
        return super().search(query, setting)


class FaissGraph(Faiss):
    name = "faiss SQ8 HNSW"
    settings = [(f" ef {ef}", ef) for ef in (16, 32, 64, 128)]

    def make(self, n):
        return self.faiss.IndexHNSWSQ(128, self.kind, 16)

    def search(self, query, setting):
        self.index.hnsw.efSearch = setting
        return super().search(query, setting)


class Hnswlib(Peer):
    name = "hnswlib f32 HNSW"
    settings = [(f" ef {ef}", ef) for ef in (16, 32, 64, 128)]

    def __init__(self):
        import hnswlib

        self.index = hnswlib.Index("l2", 128)

    def build(self, base):
        self.index.init_index(len(base) + data.INSERTS, M=16, ef_construction=128, random_seed=1)
        self.index.set_num_threads(1)
        self.insert(base, 0)

    def search(self, query, setting):
        self.index.set_ef(setting)
        return self.index.knn_query(query, 2, num_threads=1)[0]

    def insert(self, rows, start):
        self.index.add_items(rows, np.arange(start, start + len(rows)), num_threads=1)

    def bytes(self):
        return self.index.index_file_size()


class Scipy(Peer):
    name = "scipy cKDTree"
    largest = 10000
    grows = False

    def prepare(self, rows):
        return rows.astype(np.float64)

    def build(self, base):
        self.tree = data.cKDTree(base)

    def search(self, query, setting):
        return self.tree.query(query, 2, workers=1)[1]

    def bytes(self):
        return len(pickle.dumps(self.tree))


PEERS = [FaissFlat, BruteForce, Scipy, Flann, FaissLists, Usearch, FaissGraph, Hnswlib]


clock = perf_counter


def timed(call) -> tuple[float, object]:
    """Milliseconds of one call and what it returned."""
    start = clock()
    answer = call()
    return (clock() - start) * 1e3, answer


def steady(call) -> tuple[float, object]:
    """Median milliseconds of 3 to 20 calls after one that is not counted, about 0.2 s in all."""
    warm, answer = timed(call)
    return median(timed(call)[0] for _ in range(int(np.clip(200 / warm, 3, 20)))), answer


def agreement(ids: np.ndarray, truth: np.ndarray, base: np.ndarray, query: np.ndarray) -> dict[str, float]:
    """Recall of the nearest and the matches of the ratio test against the exact ones."""
    found = ((ids >= 0) & (ids < len(base))).all(axis=1)
    rows = base[np.where(found[:, None], ids, 0)].astype(np.int64)
    first, second = ((rows - query[:, None].astype(np.int64)) ** 2).sum(axis=2).T
    exact = truth[:, 2] < data.RATIO**2 * truth[:, 3]
    passed = found & (first < data.RATIO**2 * second)
    kept = exact & passed & (ids[:, 0] == truth[:, 0])
    return {"recall1": np.mean(found & (first == truth[:, 2])), "ratio_matches_kept": kept.sum() / exact.sum(),
            "ratio_matches_added": (passed & ~kept).sum() / exact.sum()}


def grow(peer: Peer, rows: np.ndarray, start: int) -> tuple[float, float]:
    """Mean and worst milliseconds of inserting a batch of 100."""
    spent = [timed(lambda: peer.insert(rows[i : i + 100], start + i))[0] for i in range(0, len(rows), 100)]
    return sum(spent) / len(spent), max(spent)


def ours(command: str, folder: Path, size: int) -> list[dict]:
    """The rows our command prints for a size."""
    line = command.replace("{size}", str(size)).replace("{data}", str(folder))
    try:
        run = subprocess.run(shlex.split(line), stdout=subprocess.PIPE, text=True)
    except OSError as error:
        print(f"ours failed ({error}): {line}", file=sys.stderr)
        return []
    if run.returncode:
        print(f"ours failed ({run.returncode}): {line}", file=sys.stderr)
    rows = csv.DictReader(line for line in run.stdout.splitlines() if not line.startswith("#"))
    return [row for row in rows if row.get("size") == str(size)]


def measure(size: int, options: argparse.Namespace) -> list[dict]:
    """All rows of the table for one size."""
    base, query, extra = (np.fromfile(options.data / f, np.uint8).reshape(-1, 128)
                          for f in (f"base_{size}.u8", f"query_{size}.u8", "insert.u8"))
    truth = np.load(options.data / f"truth_{size}.npy")
    turns, table = [], {}
    for kind in PEERS:
        if kind.name in options.skip or size > kind.largest:
            continue
        try:
            peer = kind()
        except ImportError as error:
            print(f"left out: {kind.name} ({error})", file=sys.stderr)
            continue
        ready = peer.prepare(base)
        built = timed(lambda: peer.build(ready))[0]
        print(f"{size} {kind.name}: built in {built:.0f} ms", flush=True)
        asked, each = peer.prepare(query), peer.bytes() / size
        for suffix, setting in peer.settings:
            turns.append((peer, asked, kind.name + suffix, setting))
            table[kind.name + suffix] = {"build_ms": built, "bytes_per_descriptor": each, "times": []}
    if options.ours:
        turns.insert(len(turns) // 2, (None, None, "ours", 0))
    told = {}
    for turn in range(options.rounds):
        shift = turn * len(turns) // options.rounds
        for peer, asked, name, setting in turns[shift:] + turns[:shift]:
            if peer is None:
                for row in ours(options.ours, options.data, size):
                    told.setdefault(f"ours: {row['method']}", []).append(row)
                continue
            if name not in table:
                continue
            try:
                spent, answer = steady(lambda: peer.search(asked, setting))
            except Exception as error:  # a peer's own limits must not end an unattended run
                print(f"left out: {name} at {size} ({error})", file=sys.stderr)
                del table[name]
                continue
            table[name]["times"].append(spent)
            if turn == 0:
                table[name] |= agreement(peer.ids(answer), truth, base, query)
    for peer, _, name, _ in turns:
        if peer is not None and name in table:
            row = table[name]
            if peer.grows and not hasattr(peer, "grown"):
                peer.grown = grow(peer, peer.prepare(extra), size)
            built = (row["build_ms"],) * 2 if isinstance(peer, (Flann, Scipy)) else ("", "")
            row["insert100_ms_mean"], row["insert100_ms_worst"] = getattr(peer, "grown", built)
    for name, rows in told.items():
        middle = {c: median(float(r[c]) for r in rows) for c in OURS if rows[0].get(c)}
        table[name] = middle | {"times": [float(r["ms_per_300_queries"]) for r in rows]}
        if rows[0].get("ratio_matches_added"):
            table[name]["ratio_matches_added"] = median(float(r["ratio_matches_added"]) for r in rows)
    for name, row in table.items():
        times = row.pop("times")
        row |= {"method": name, "size": size, "ms_per_300_queries": median(times), "ms_low": min(times),
                "ms_high": max(times), "rounds": len(times)}
    return list(table.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--images", nargs="+", default=[], help="pictures of the maps, to make missing data")
    parser.add_argument("--outside", nargs="+", default=[], help="pictures that are in no map")
    parser.add_argument("--ours", help="command that prints our rows")
    parser.add_argument("--sizes", nargs="+", type=int, default=data.SIZES)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--cpu-time", action="store_true", help="time peers by the processor's clock")
    parser.add_argument("--skip", nargs="*", default=[], help="names of peers to leave out, as in PEERS")
    parser.add_argument("--out", type=Path, required=True, help="path without suffix")
    options = parser.parse_args()
    if any(not (options.data / f"truth_{n}.npy").exists() for n in options.sizes):
        if not options.images or not options.outside:
            raise SystemExit("data is missing: give --images and --outside")
        data.make(options.data, options.images, options.outside, options.sizes)
    if options.cpu_time:
        global clock
        clock = process_time
    os.sched_setaffinity(0, {options.core})
    cv2.setNumThreads(1)
    rows = []
    for size in options.sizes:
        rows += measure(size, options)
        with open(options.out.with_suffix(".csv"), "w", newline="") as file:
            table = csv.DictWriter(file, COLUMNS, restval="")
            table.writeheader()
            table.writerows({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
        plot.main(options.out.with_suffix(".csv"), options.out.with_suffix(".svg"), options.out.with_suffix(".md"))


if __name__ == "__main__":
    main()
