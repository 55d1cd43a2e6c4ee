#!/usr/bin/env python3
"""Table of the field cases before and after a change: what two builds of the program say to the same inputs.

Every case is a folder with a `make.py` that makes an input from this repository's fixtures and whose docstring ends with
`Run: python make.py DIR, then in DIR: COMMAND ($B is the program)`. For each case both programs run the command in a fresh
folder; the table has the exit codes, the names of the warnings and the last line that each of them wrote.

    python3 xtask/scripts/field_cases.py --cases CASES --before OLD --after NEW --out table.md [--only C0 I1 ...]

CASES is the folder of the cases, OLD and NEW are programs. Nothing is judged here: what is expected stands in the README of
the cases, and the table is read beside it.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile


def command_of(case):
    """The title of a case and its shell command, from the docstring of its make.py."""
    text = (case / "make.py").read_text()
    doc = text.split('"""')[1]
    title = doc.strip().splitlines()[0]
    found = re.search(r"then in DIR: (.*?)\s*\(\$B is the program\)", doc, re.S)
    return title, found.group(1) if found else None


def outcome(case, command, program, fixtures, limit_s):
    """Exit code, names of warnings, last line said."""
    with tempfile.TemporaryDirectory(prefix="field-case-") as folder:
        environment = {**os.environ, "FIXTURES": str(fixtures), "B": str(program)}
        # Some generators forget to import what they use.
        forgotten = "import builtins, math, runpy, sys; builtins.math = math; runpy.run_path(sys.argv.pop(1), run_name='__main__')"
        made = subprocess.run(
            [sys.executable, "-c", forgotten, str(case / "make.py"), folder],
            env=environment,
            capture_output=True,
            text=True,
        )
        if made.returncode != 0:
            return "not made", "", made.stderr.strip().splitlines()[-1][:200] if made.stderr.strip() else ""
        try:
            # Exit codes of every call of the program in the line, in order.
            wrapper = pathlib.Path(folder) / ".program"
            wrapper.write_text(f'#!/bin/sh\n"{program}" "$@"\ncode=$?\necho $code >> "{folder}/.codes"\nexit $code\n')
            wrapper.chmod(0o755)
            environment["B"] = str(wrapper)
            run = subprocess.run(
                ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, timeout=limit_s
            )
        except subprocess.TimeoutExpired:
            return "timeout", "", f"no end within {limit_s} s"
        codes = pathlib.Path(folder) / ".codes"
        codes = ",".join(codes.read_text().split()) if codes.exists() else str(run.returncode)
        said = run.stderr.decode(errors="replace").replace(folder, "DIR")
        names = sorted(set(re.findall(r"warning: \[([a-z0-9-]+)\]", said)))
        lines = [line for line in said.splitlines() if line.strip() and not line.startswith("frame ")]
        spoken = [line for line in lines if line.startswith("mono-slam: ") and "warning: [" not in line]
        last = (spoken or lines or [""])[-1]
        return codes, " ".join(names), last


def cell(text):
    text = text if len(text) <= 300 else text[:300] + "…"
    return text.replace("|", "\\|").replace("\n", " ")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", required=True, type=pathlib.Path)
    parser.add_argument("--before", type=pathlib.Path)
    parser.add_argument("--after", required=True, type=pathlib.Path)
    parser.add_argument("--fixtures", type=pathlib.Path, default=pathlib.Path(__file__).parents[2] / "fixtures")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one command")
    arguments = parser.parse_args()
    rows = ["| case | situation | before | after |", "|---|---|---|---|"]
    for case in sorted(arguments.cases.iterdir()):
        if not (case / "make.py").exists():
            continue
        if arguments.only and not any(case.name.startswith(only) for only in arguments.only):
            continue
        title, command = command_of(case)
        if command is None:
            continue
        cells = []
        for program in (arguments.before, arguments.after):
            if program is None:
                cells.append("")
                continue
            codes, names, last = outcome(
                case, command, program.resolve(), arguments.fixtures.resolve(), arguments.limit
            )
            cells.append(cell(f"exit {codes}; " + (f"**{names}**; " if names else "") + last))
        rows.append(f"| {case.name} | {cell(title)} | {cells[0]} | {cells[1]} |")
        print(rows[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
