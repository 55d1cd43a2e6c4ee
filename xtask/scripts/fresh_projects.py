"""Shows that every library crate works by itself: its README, alone, in a fresh project against its package.

    python3 xtask/scripts/fresh_projects.py [--out DIR] [--only CRATE ...] [--plain]

The script packages the crates (`cargo xtask package`), unpacks them, and for each library makes a Cargo project outside the
workspace whose only dependency of ours is that package under its published name; what the code itself names beside it
(nalgebra, rand, other crates of the family) is added as a reader would add it, and shown in the table. Every Rust block of the
README becomes a program, as rustdoc would make it: hidden lines are shown, a `main` is put around what has none. All are
built; those that are not marked `no_run` are run. With `--plain` the crates are taken from the work tree by path instead.
One target folder serves all projects (CARGO_TARGET_DIR, or `target` in DIR). Exit code 1 when anything fails.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def cargo(*arguments, cwd=ROOT, env=None):
    return subprocess.run(["cargo", *map(str, arguments)], cwd=cwd, env=env, capture_output=True, text=True)


def blocks(readme):
    """(attributes, code) of every Rust block, hidden lines shown."""
    found = []
    for attributes, code in re.findall(r"^```(rust[^\n]*)\n(.*?)^```", readme, re.S | re.M):
        lines = [line[2:] if line.startswith("# ") else "" if line == "#" else line for line in code.splitlines()]
        found.append((attributes.split(",")[1:], "\n".join(lines) + "\n"))
    return found


def program(code):
    """The code with a main function, as rustdoc puts it around an example."""
    if re.search(r"\bfn main\(", code):
        return code
    if re.search(r"\bOk::<", code):
        return ("fn main() {\n#[allow(non_snake_case)]\nfn example() -> Result<(), impl core::fmt::Debug> {\n"
                f"{code}}}\nexample().unwrap()\n}}\n")
    return f"fn main() {{\n{code}}}\n"


def crates_named(code):
    """The crates that the paths of the code begin with."""
    used = set(re.findall(r"^\s*use ([a-z_0-9]+)::", code, re.M)) | set(re.findall(r"(?<![\w:])([a-z_0-9]+)::[\w<{]", code))
    return used - {"std", "core", "alloc", "crate", "self", "super"}


def fresh(member, path):
    """The file as of now: cargo gives all files of a package one old date, by which a target folder used before would not see
    that they changed."""
    return tarfile.data_filter(member, path).replace(mtime=time.time())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "fresh")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--plain", action="store_true", help="the crates of the work tree, not their packages")
    options = parser.parse_args()
    out = options.out.resolve()
    projects = out / "projects"
    shutil.rmtree(projects, ignore_errors=True)
    projects.mkdir(parents=True)
    env = dict(os.environ)
    env.setdefault("CARGO_TARGET_DIR", str(out / "target"))

    told = cargo("metadata", "--format-version", "1", "--locked")
    metadata = json.loads(told.stdout)
    versions = {p["name"].replace("-", "_"): p for p in sorted(metadata["packages"], key=lambda p: p["version"])}
    ours = {p["name"]: p for p in metadata["packages"] if p["source"] is None and p["publish"] is None}
    libraries = [n for n, p in sorted(ours.items()) if any("lib" in t["kind"] for t in p["targets"])]

    folders, family = {}, {}
    if options.plain:
        for name, package in ours.items():
            folders[name], family[name] = Path(package["manifest_path"]).parent, name
    else:
        packaged = subprocess.run(["cargo", "run", "--quiet", "--package", "xtask", "--", "package", "--out", str(out / "package")],
                                  cwd=ROOT, capture_output=True, text=True)
        if packaged.returncode:
            sys.exit(packaged.stderr)
        for line in packaged.stdout.splitlines():
            words = line.split()
            if len(words) >= 2 and words[0] in ours:
                family[words[0]] = words[1]
        unpacked = out / "unpacked"
        shutil.rmtree(unpacked, ignore_errors=True)
        for name, package in ours.items():
            stem = f"{family[name]}-{package['version']}"
            with tarfile.open(out / "package" / "target" / "package" / f"{stem}.crate") as archive:
                archive.extractall(unpacked, filter=fresh)
            folders[name] = unpacked / stem
            inside = {entry.name for entry in folders[name].iterdir()}
            missing = {"LICENSE-APACHE", "LICENSE-MIT", "README.md"} - inside
            if missing:
                sys.exit(f"{stem}.crate lacks {', '.join(sorted(missing))}")

    members, rows = [], []
    for name in libraries:
        if options.only and name not in options.only:
            continue
        code = blocks((folders[name] / "README.md").read_text())
        project = projects / name
        (project / "src" / "bin").mkdir(parents=True)
        beside, added = [], []
        for used in sorted(set().union(*(crates_named(text) for _, text in code)) if code else []):
            own = used.replace("_", "-")
            if own in ours:
                source = f'package = "{family[own]}", version = "{ours[own]["version"]}"'
                if options.plain:
                    source += f', path = "{folders[own]}"'
                added.append(f"{own} = {{ {source} }}")
                if own != name:
                    beside.append(own)
            elif used in versions:
                added.append(f'{versions[used]["name"]} = "{versions[used]["version"]}"')
                beside.append(versions[used]["name"])
        (project / "Cargo.toml").write_text(
            f'[package]\nname = "fresh-{name}"\nversion = "0.0.0"\nedition = "2024"\n\n[dependencies]\n' + "\n".join(added) + "\n")
        for index, (_, text) in enumerate(code):
            (project / "src" / "bin" / f"{name}-{index}.rs").write_text(program(text))
        members.append(name)
        rows.append((name, code, beside))

    patch = "" if options.plain else "\n[patch.crates-io]\n" + "".join(
        f'{family[name]} = {{ path = "{folders[name]}" }}\n' for name in sorted(ours))
    (projects / "Cargo.toml").write_text(
        f'[workspace]\nresolver = "3"\nmembers = {json.dumps(members)}\n{patch}\n'
        "[profile.dev]\nopt-level = 1\ndebug = false\n")
    shutil.copy(ROOT / "Cargo.lock", projects / "Cargo.lock")

    failed = 0
    print(f"{'crate':<20}{'blocks':>7}{'built':>7}{'run':>5}{'seconds':>9}  beside it", flush=True)
    for name, code, beside in rows:
        start = time.monotonic()
        # One package at a time: features of the others must not help.
        build = cargo("build", "--quiet", "--package", f"fresh-{name}", cwd=projects, env=env)
        seconds = time.monotonic() - start
        built = len(code) if build.returncode == 0 else 0
        run, errors = 0, [] if built == len(code) else [build.stderr]
        for index, (attributes, _) in enumerate(code):
            if not built or "no_run" in attributes:
                continue
            once = cargo("run", "--quiet", "--package", f"fresh-{name}", "--bin", f"{name}-{index}", cwd=projects, env=env)
            run += once.returncode == 0
            if once.returncode:
                errors.append(once.stderr)
        print(f"{name:<20}{len(code):>7}{built:>7}{run:>5}{seconds:>9.1f}  {', '.join(beside)}", flush=True)
        for error in errors:
            failed += 1
            print(error, flush=True)
    wanted = "their packages" if not options.plain else "the work tree"
    print(f"{len(rows)} crates against {wanted}, {failed} failures")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
